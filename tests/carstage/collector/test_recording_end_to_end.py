"""The collector's process with the real wheel against the embedded simulator."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from carstage.rawlog import format as raw
from carstage.rawlog.reader import EpisodeLog
from carstage.server import EmbeddedServer, free_port
from running_collector import END_S, GIVEN_BACK, Collector
from torn_segments import read_torn

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("collector")]

PlanMaker = Callable[..., dict[str, Any]]


NO_BUS = {"count": 1, "filter": "vehicle.audi.*", "base_type": "bus"}


def truth(folder: Path) -> dict[str, bytes]:
    """Bytes of everything that is the same in every attempt: all but the ledger."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*.seg"))
        if path.parent.name != raw.LEDGER
    }


def test_every_frame_of_every_kind_is_recorded(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    folder = tmp_path / "raw"
    code, events = collector.run(make_plan(folder))
    assert code == 0
    names = [event["event"] for event in events]
    assert names[:4] == ["collector_started", "connected", "episode_started", "actors_spawned"]
    assert names[-2:] == ["episode_recorded", "collector_finished"]
    assert events[-2]["incomplete"] == 0
    assert [event for event in events if event["event"] == "tick"][-1]["tick"] == 19

    log = EpisodeLog(folder)
    assert log.is_complete()
    assert log.header["map"] == "Carla/Maps/Stage01"
    assert log.header["spawned"] == {"vehicles": 8, "pedestrians": 4}
    rows = log.ledger()
    first = log.header["first_frame"]
    assert [row["frame"] for row in rows] == list(range(first, first + 20))
    assert [row["k"] for row in rows] == list(range(20))
    times_s = np.array([row["timestamp_s"] for row in rows]) - log.header["first_timestamp_s"]
    np.testing.assert_allclose(times_s, np.arange(20) / 10, atol=1e-5)
    sensors = make_plan()["episodes"][0]["spec"]["sensors"]
    for row in rows:
        assert list(row["sensors"]) == sorted(sensor["id"] for sensor in sensors)
        assert {outcome["state"] for outcome in row["sensors"].values()} == {"ok"}
    pixels = 96 * 54
    sizes = {"rgb": 4 * pixels, "depth": 4 * pixels, "semantic": 4 * pixels, "flow": 8 * pixels}
    sizes["imu"] = 56
    point_bytes = {"lidar": 16, "semantic_lidar": 24}
    for sensor in sensors:
        assert log.sealed_segments(sensor["id"]) == (0, 1)
        records = [r for index in (0, 1) for r in log.read_segment(sensor["id"], index)]
        assert [record.frame for record in records] == [row["frame"] for row in rows]
        for record in records:
            size = sizes.get(sensor["kind"])
            assert size is None or record.payload.nbytes == size
            if sensor["kind"] in point_bytes:
                points = sum(record.meta["counts"])
                assert record.payload.nbytes == point_bytes[sensor["kind"]] * points > 0
                assert len(record.meta["counts"]) == 8
            if sensor["kind"] == "radar":
                assert record.payload.nbytes % 16 == 0
                assert record.payload.nbytes > 0


def test_capture_does_not_wait_for_grids_and_voxels(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    """Nobody makes any here: every frame is recorded, and is the same as without."""
    plan = make_plan(tmp_path / "without", tmp_path / "with", steps=4)
    asked = {
        "birds_eye": {"length_m": 100.0, "width_m": 100.0, "resolution_m": 0.2},
        "occupancy": {"frame": "ego", "ahead_m": 40.0, "behind_m": 40.0, "left_m": 40.0,
                      "right_m": 40.0, "up_m": 5.4, "down_m": 1.0, "resolution_m": 0.4},
    }  # fmt: skip
    plan["episodes"][1]["spec"]["labels"] = asked
    code, events = collector.run(plan)
    assert code == 0
    ticks = [e["ticks"] for e in events if e["event"] == "episode_recorded"]
    assert ticks == [4, 4]
    assert truth(tmp_path / "without") == truth(tmp_path / "with")
    assert EpisodeLog(tmp_path / "with").spec.labels.occupancy is not None


def test_the_world_of_each_frame_is_recorded(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    folder = tmp_path / "raw"
    assert collector.run(make_plan(folder))[0] == 0
    log = EpisodeLog(folder)
    actors = log.actors()
    frames = [frame for index in (0, 1) for frame in log.world_frames(index)]
    assert [frame.tick for frame in frames] == list(range(20))
    ego = actors[log.header["ego_id"]]
    assert ego.type_id == "vehicle.tesla.model3"
    assert ego.attributes["role_name"] == "hero"
    assert ego.semantic_tags == (14,)
    assert (ego.box_extent > 0.5).all()
    kinds = [info.type_id.split(".")[0] for info in actors.values()]
    assert kinds.count("vehicle") == 9
    assert kinds.count("walker") == 4
    for name, actor_id in log.header["sensor_actor_ids"].items():
        assert actors[actor_id].parent == ego.id, name
    for frame in frames:
        assert set(frame.actor_id.tolist()) <= set(actors)
        assert (np.diff(frame.actor_id.astype(np.int64)) > 0).all()
        assert frame.meta["ego"]["id"] == ego.id
        assert frame.meta["weather"]["cloudiness"] == 12.5
        assert len(frame.meta["vehicle_lights"]) == 9
        assert set(frame.meta["traffic_lights"].values()) <= {"Red", "Yellow", "Green"}
        assert frame.meta["delta_s"] == pytest.approx(0.1)
    rows = [frame.row(ego.id) for frame in frames]
    path = np.array([frame.location[row] for frame, row in zip(frames, rows, strict=True)])
    speed = np.array([frame.velocity[row] for frame, row in zip(frames, rows, strict=True)])
    np.testing.assert_allclose(np.diff(path, axis=0) / 0.1, speed[1:], atol=0.5)


def test_the_same_plan_gives_the_same_bytes_in_one_process_and_in_another(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    folders = [tmp_path / name for name in ("first", "second", "third")]
    assert collector.run(make_plan(*folders[:2]))[0] == 0
    assert collector.run(make_plan(folders[2]))[0] == 0
    first, *others = (truth(folder) for folder in folders)
    assert len(first) == 2 * (len(make_plan()["episodes"][0]["spec"]["sensors"]) + 1)
    for other in others:
        assert other == first


def test_only_planned_frames_are_saved(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    folder = tmp_path / "raw"
    plan = make_plan(folder, steps=10, save_every=4)
    plan["raw_store"] = "mmap"
    assert collector.run(plan)[0] == 0
    log = EpisodeLog(folder)
    assert [row["k"] for row in log.ledger()] == [0, None, None, None, 1, None, None, None, 2, None]
    assert [record.tick for record in log.read_segment("CAM", 0)] == [0, 4, 8]
    assert len(log.world_frames(0)) == 10
    assert (folder / "CAM" / "000000.raw").stat().st_size == 3 * 4 * 96 * 54
    assert not (folder / "LIDAR" / "000000.raw").exists()


def test_large_payloads_that_need_not_last_are_in_files_that_are_used_again(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    plans = {name: make_plan(tmp_path / name, steps=3) for name in ("lasting", "passing")}
    for plan in plans.values():
        for sensor in plan["episodes"][0]["spec"]["sensors"]:
            if sensor["id"] == "CAM":
                sensor["attributes"] |= {"image_size_x": "320", "image_size_y": "240"}
    plans["passing"]["durable"] = False
    for plan in plans.values():
        assert collector.run(plan)[0] == 0
    streams = {path.parent.name for path in (tmp_path / "passing").rglob("000000.blk")}
    assert "CAM" in streams
    assert not streams & {"IMU", "GNSS", raw.WORLD, raw.LEDGER}
    assert not list((tmp_path / "lasting").rglob("*.blk"))
    assert (tmp_path / "passing" / "CAM" / "000000.blk").stat().st_size == 3 * 4 * 320 * 240
    passing, lasting = (
        [(r.tick, r.meta, bytes(r.payload)) for r in EpisodeLog(folder).read_segment("CAM", 0)]
        for folder in (tmp_path / "passing", tmp_path / "lasting")
    )
    assert len(passing) == 3
    assert passing == lasting


def test_a_termination_signal_gives_everything_back_and_ends_with_130(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    folder = tmp_path / "raw"
    process = collector.start(make_plan(folder, steps=2000))
    collector.await_event(process, "segment_sealed")
    process.send_signal(signal.SIGTERM)
    output, _ = process.communicate(timeout=END_S)
    assert process.returncode == 130
    events = [json.loads(line) for line in output.splitlines()]
    assert [event["event"] for event in events[-3:]] == [
        *("episode_aborted", "error", "collector_finished"),
    ]
    assert "SIGTERM" in events[-3]["reason"]
    assert events[-1]["exit_code"] == 130
    assert collector.left_on_server() == GIVEN_BACK
    # Every frame that was begun is whole: the ledger's last row and the last picture agree.
    last = {
        stream: read_torn(
            max((folder / stream).glob("*.open"), default=None) or _last(folder, stream)
        )
        for stream in ("CAM", "ledger")
    }
    assert last["CAM"].index == last["ledger"].index
    assert [r.tick for r in last["CAM"].records] == [r.tick for r in last["ledger"].records]


def _last(folder: Path, stream: str) -> Path:
    return max((folder / stream).iterdir())


def test_a_killed_collector_leaves_whole_records_and_the_retry_is_the_same(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    reference, killed, retried = (tmp_path / name for name in ("reference", "killed", "retried"))
    assert collector.run(make_plan(reference))[0] == 0
    process = collector.start(make_plan(killed, steps=2000))
    while collector.await_event(process, "tick")["tick"] < 12:
        pass
    process.kill()
    process.communicate(timeout=END_S)
    log = EpisodeLog(killed)
    expected = EpisodeLog(reference)
    assert not log.is_complete()
    for stream in log.streams:
        for path in sorted((killed / stream).glob("*.open")):
            if not path.stat().st_size:
                continue  # killed between making the file and writing its header
            found = read_torn(path)
            assert [r.sequence for r in found.records] == list(range(len(found.records)))
            if stream != raw.LEDGER and found.index < 2:
                whole = expected.read_segment(stream, found.index)
                pairs = zip(found.records, whole, strict=False)
                assert all(one.payload == other.payload for one, other in pairs)
    assert collector.run(make_plan(retried))[0] == 0
    assert truth(retried) == truth(reference)


@pytest.mark.parametrize("what", ["stdin", "stdout"])
def test_a_starter_that_is_gone_ends_the_recording(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path, what: str
) -> None:
    plan = make_plan(tmp_path / "raw", steps=2000)
    process = collector.start(plan, "--exit-with-input", stdin=subprocess.PIPE)
    collector.await_event(process, "segment_sealed")
    stream = getattr(process, what)
    stream.close()
    setattr(process, what, None)
    assert process.wait(END_S) == 130
    assert collector.left_on_server() == GIVEN_BACK


@pytest.mark.parametrize(
    ("changes", "kind", "message"),
    [
        ({"map": "Stage1"}, "scene", "no map 'Stage1'"),
        ({"dialect": "0.9.15"}, "version", "planned for CARLA 0.9.15, the server is 0.9.16"),
        (
            {"ego": {"blueprint": "vehicle.tesla.model4", "spawn_index": 3}},
            *("scene", "no blueprint 'vehicle.tesla.model4'"),
        ),
        (
            {"ego": {"blueprint": "vehicle.tesla.model3", "spawn_index": 9999}},
            *("scene", r"ego.spawn_index: 9999"),
        ),
        ({"vehicles": {"count": 1, "filter": "boat.*"}}, "scene", "vehicles.filter"),
        (
            {"vehicles": {"count": 1, "filter": "vehicle.*", "groups": [NO_BUS]}},
            *("scene", "vehicles.groups[0].filter"),
        ),
        (
            {"scenario": {"kind": "route", "through": [5000]}},
            *("scene", "scenario.through[0]: map Stage01 has no spawn point 5000"),
        ),
        ({"map_layers": ["Bildings"]}, "scene", "map.layers: this CARLA client does not know"),
        ({"vehicles": {"count": 1, "filter": "sensor.*"}}, "scene", "vehicles.filter"),
        (
            {"weather": {"preset": "ClearNon", "parameters": {}, "lights": "auto"}},
            *("scene", "does not know 'ClearNon'"),
        ),
    ],
)
def test_what_the_server_cannot_do_is_said_and_given_back(
    collector: Collector,
    make_plan: PlanMaker,
    tmp_path: Path,
    changes: dict[str, Any],
    kind: str,
    message: str,
) -> None:
    code, events = collector.run(make_plan(tmp_path / "raw", **changes))
    assert code == 1
    (error,) = [event for event in events if event["event"] == "error"]
    assert error["kind"] == kind
    assert message in error["message"]
    assert error["hint"]
    assert collector.left_on_server() == GIVEN_BACK


def test_a_failed_episode_does_not_keep_the_next_one_from_being_recorded(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    plan = make_plan(tmp_path / "bad", tmp_path / "good", steps=3)
    plan["episodes"][0]["spec"]["map"] = "Nowhere"
    code, events = collector.run(plan)
    assert code == 1
    ends = [e["event"] for e in events if e["event"] in ("episode_aborted", "episode_recorded")]
    assert ends == ["episode_aborted", "episode_recorded"]
    assert EpisodeLog(tmp_path / "good").is_complete()


def test_nobody_at_the_address_is_said_with_host_and_port(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    collector.port = free_port()
    plan = make_plan(tmp_path / "raw")
    plan["server"]["timeout_s"] = 0.5
    code, events = collector.run(plan)
    assert code == 1
    (error,) = [event for event in events if event["event"] == "error"]
    assert error["kind"] == "connection"
    assert f"127.0.0.1:{collector.port}" in error["message"]


def test_a_bad_plan_ends_with_2(collector: Collector, make_plan: PlanMaker) -> None:
    code, events = collector.run(make_plan(fps=-1.0))
    assert code == 2
    assert [event["event"] for event in events] == ["error", "collector_finished"]
    assert events[0]["message"].startswith("episodes[0].spec.fps")


@pytest.mark.parametrize(("lights", "bits"), [("on", {1 | 2}), ("off", {0})])
def test_vehicle_lights_are_on_or_off_as_planned(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path, lights: str, bits: set[int]
) -> None:
    weather = {"preset": "ClearNight", "parameters": {}, "lights": lights}
    folder = tmp_path / "raw"
    assert collector.run(make_plan(folder, steps=1, weather=weather))[0] == 0
    (frame,) = EpisodeLog(folder).world_frames(0)
    assert set(frame.meta["vehicle_lights"].values()) == bits


def test_a_server_that_dies_ends_the_recording(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    with EmbeddedServer(threads=1, log_path=tmp_path / "server.log") as server:
        collector.port = server.endpoint.port
        plan = make_plan(tmp_path / "raw", tmp_path / "next", steps=2000)
        plan["server"]["timeout_s"] = 3.0
        process = collector.start(plan)
        collector.await_event(process, "segment_sealed")
        assert server.endpoint.pid is not None
        os.kill(server.endpoint.pid, signal.SIGKILL)
        output, _ = process.communicate(timeout=END_S)
    # The client library aborts the process when a call of its Traffic Manager's thread fails.
    assert process.returncode in (1, -signal.SIGABRT)
    if process.returncode == 1:
        events = [json.loads(line) for line in output.splitlines()]
        ends = [e["event"] for e in events if e["event"] not in ("tick", "segment_sealed")]
        assert ends == ["episode_aborted", "error", "collector_finished"]
    assert EpisodeLog(tmp_path / "raw").sealed_segments("CAM")[0] == 0


def test_an_asynchronous_server_is_followed(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    folder = tmp_path / "raw"
    plan = make_plan(folder, steps=6)
    plan["episodes"][0]["spec"]["timing"]["mode"] = "async"
    assert collector.run(plan)[0] == 0
    log = EpisodeLog(folder)
    assert log.is_complete()
    frames = [row["frame"] for row in log.ledger()]
    assert frames == list(range(frames[0], frames[0] + 6)), "a gap has its row, too"
    saved = [row["k"] for row in log.ledger() if row["k"] is not None]
    assert saved == list(range(len(saved)))
    assert len(log.world_frames(0)) == len(saved)
    assert collector.left_on_server() == GIVEN_BACK


CAMERAS = {"CAM", "CAM.depth", "SEMANTIC", "CAM.instance"}


def world_of(folder: Path) -> tuple[Any, Any]:
    """What the log says of the world, but for the ``sensor_tick`` that sensors were given."""
    log = EpisodeLog(folder)
    actors = {
        number: (
            actor.type_id,
            actor.parent,
            {k: v for k, v in actor.attributes.items() if k != "sensor_tick"},
        )
        for number, actor in log.actors().items()
    }
    frames = [
        (frame.tick, frame.meta, frame.actor_id.tolist(), frame.location.tobytes())
        for index in log.segments
        for frame in log.world_frames(index)
    ]
    return actors, frames


def test_cameras_that_rest_where_nothing_is_saved_give_the_same_bytes(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    states = {}
    for name, rests in (("all", False), ("some", True)):
        plan = make_plan(tmp_path / name, steps=10, save_every=3, fps=30.0)
        plan["server"]["exact_sensor_tick"] = rests
        code, events = collector.run(plan)
        assert code == 0, events
        assert events[-2]["incomplete"] == 0
        log = EpisodeLog(tmp_path / name)
        rows = log.ledger()
        assert [row["k"] for row in rows] == [0, None, None, 1, None, None, 2, None, None, 3]
        states[name] = [
            {sensor: one["state"] for sensor, one in row["sensors"].items()} for row in rows
        ]
        ticks = log.header["sensor_attributes"]["CAM"]["sensor_tick"]
        assert float(ticks) == (pytest.approx(0.1) if rests else 0.0)
        assert float(log.header["sensor_attributes"]["FLOW"]["sensor_tick"]) == 0.0
    every, some = (
        {path: data for path, data in truth(tmp_path / name).items() if raw.WORLD not in path}
        for name in ("all", "some")
    )
    assert every == some
    every_world, some_world = (world_of(tmp_path / name) for name in ("all", "some"))
    assert every_world == some_world
    assert {state for row in states["all"] for state in row.values()} == {"ok"}
    for tick, row in enumerate(states["some"]):
        off = {sensor for sensor, state in row.items() if state == "off"}
        assert off == (CAMERAS if tick % 3 else set())
        assert {state for sensor, state in row.items() if sensor not in off} == {"ok"}
