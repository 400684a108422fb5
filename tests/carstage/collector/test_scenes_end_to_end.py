"""Scenes that are recorded: carriers, weather, scenarios, own timelines, and every way out."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from carstage.rawlog.reader import EpisodeLog, WorldFrame
from carstage.server import free_port
from running_collector import END_S, GIVEN_BACK, Collector

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("collector")]

PlanMaker = Callable[..., dict[str, Any]]
EMPTY = {"count": 0, "filter": "vehicle.*"}
NOBODY = {"count": 0, "filter": "walker.pedestrian.*"}


def sensor(name: str, blueprint: str, **more: Any) -> dict[str, Any]:
    pose = {"x_m": 0.0, "y_m": 0.0, "z_m": 0.0, "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0}
    kind = {"sensor.camera.rgb": "rgb"}.get(blueprint, blueprint.rsplit(".", 1)[-1])
    return {
        "id": name,
        "kind": kind,
        "blueprint": blueprint,
        "attributes": {"image_size_x": "32", "image_size_y": "18"} if kind == "rgb" else {},
        **more,
        "pose": {**pose, **more.get("pose", {})},
    }


GNSS = sensor("GNSS", "sensor.other.gnss")


def record(collector: Collector, plan: dict[str, Any], folder: Path) -> EpisodeLog:
    code, events = collector.run(plan)
    assert code == 0, [event for event in events if event["event"] == "error"]
    return EpisodeLog(folder)


def world(log: EpisodeLog) -> list[WorldFrame]:
    return [frame for index in log.sealed_segments("world") for frame in log.world_frames(index)]


def places(log: EpisodeLog, actor_id: int) -> np.ndarray:
    return np.array([frame.location[frame.row(actor_id)] for frame in world(log)])


def test_sensors_hang_where_they_are_planned_and_the_weather_changes(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    folder = tmp_path / "raw"
    spot = {"x_m": 95.0, "y_m": 100.0, "z_m": 9.0, "pitch_deg": -25.0, "yaw_deg": 40.0}
    light = "traffic.traffic_light"
    sensors = [
        sensor("FIXED", "sensor.camera.rgb", attach_to="world", pose=spot),
        sensor("DRONE", "sensor.camera.rgb", attachment="follow", pose={"z_m": 30.0, "x_m": 2.0}),
        sensor("LIGHT", "sensor.camera.rgb", attach_to=light, pose={"z_m": 6.0}),
        sensor("OTHER", "sensor.other.imu", attach_to="vehicle.*", attach_index=1),
        sensor("CHASE", "sensor.camera.rgb", attachment="spring_arm", pose={"x_m": -5.0}),
    ]
    night = {"preset": None, "parameters": {"sun_altitude_angle": -30.0}}
    weather = {"preset": "ClearNoon", "parameters": {}, "lights": "auto"}
    weather["changes"] = [{"at_s": 0.6, **night}]
    plan = make_plan(
        folder, steps=8, sensors=sensors, weather=weather, pedestrians=NOBODY, warmup_ticks=4
    )
    log = record(collector, plan, folder)
    frames, ids = world(log), log.header["sensor_actor_ids"]
    np.testing.assert_allclose(places(log, ids["FIXED"]), [[95.0, 100.0, 9.0]] * 8, atol=1e-4)
    ego = places(log, log.header["ego_id"])
    drone = places(log, ids["DRONE"])
    # A step behind: it hovers over where its carrier was last seen.
    np.testing.assert_allclose(drone[1:], ego[:-1] + np.array([2.0, 0.0, 30.0]), atol=1e-3)
    turns = [frame.rotation_deg[frame.row(ids["DRONE"])] for frame in frames]
    np.testing.assert_allclose(turns, np.zeros((8, 3)), atol=1e-3)
    actors = log.actors()
    carriers = log.header["sensor_carrier_ids"]
    assert actors[carriers["LIGHT"]].type_id == "traffic.traffic_light"
    assert actors[carriers["OTHER"]].type_id.startswith("vehicle.")
    assert carriers["OTHER"] != log.header["ego_id"] == carriers["DRONE"]
    assert carriers["FIXED"] == 0
    pole = places(log, carriers["LIGHT"]) + np.array([0.0, 0.0, 6.0])
    np.testing.assert_allclose(places(log, ids["LIGHT"]), pole, atol=1e-3)

    altitude_deg = [frame.meta["weather"]["sun_altitude_angle"] for frame in frames]
    expected = [45.0 - 75.0 * min(tick, 6) / 6 for tick in range(8)]
    np.testing.assert_allclose(altitude_deg, expected, atol=1e-3)
    assert set(frames[0].meta["vehicle_lights"].values()) <= {0, 4, 8}, "day, brakes at most"
    assert all(bits & 3 == 3 for bits in frames[-1].meta["vehicle_lights"].values())


@pytest.mark.parametrize("through", [143, 8], ids=["round the corner", "straight on"])
def test_the_ego_drives_the_planned_route(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path, through: int
) -> None:
    plan = make_plan(
        tmp_path / "raw",
        steps=170,
        sensors=[GNSS],
        vehicles=EMPTY,
        pedestrians=NOBODY,
        traffic={"ignore_lights_percent": 100.0, "include_ego": True},
        scenario={"kind": "route", "through": [through]},
    )
    log = record(collector, plan, tmp_path / "raw")
    goal = {143: (57.0, 83.0), 8: (35.0, 110.0)}[through]
    path = places(log, log.header["ego_id"])[:, :2]
    assert np.linalg.norm(path - goal, axis=1).min() < 4.0


def test_an_ego_that_holds_stands_while_the_others_drive(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    plan = make_plan(tmp_path / "raw", steps=25, sensors=[GNSS], scenario={"kind": "hold"})
    plan["episodes"][0]["spec"]["weather"]["preset"] = "ClearNight"
    log = record(collector, plan, tmp_path / "raw")
    ego_id = log.header["ego_id"]
    assert np.ptp(places(log, ego_id), axis=0).max() < 0.05
    moved = [
        float(np.ptp(places(log, actor.id)[:, :2], axis=0).max())
        for actor in log.actors().values()
        if actor.type_id.startswith("vehicle.") and actor.id != ego_id
    ]
    assert max(moved) > 1.0
    assert world(log)[-1].meta["vehicle_lights"][str(ego_id)] & 3 == 3


def test_a_replay_moves_everybody_as_recorded(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    steps = 12
    first = record(
        collector, make_plan(tmp_path / "first", steps=steps, sensors=[GNSS]), tmp_path / "first"
    )
    frames, actors = world(first), first.actors()
    users = [i for i, a in sorted(actors.items()) if a.type_id.startswith(("vehicle.", "walker."))]
    users.sort(key=lambda actor_id: actor_id != first.header["ego_id"])

    def poses(actor_id: int) -> list[list[float]]:
        rows = [(frame, frame.row(actor_id)) for frame in frames]
        return [[*f.location[r].tolist(), *f.rotation_deg[r].tolist()] for f, r in rows]

    roles = [{"blueprint": actors[i].type_id, "attributes": {}, "poses": poses(i)} for i in users]
    roles[0]["attributes"] = {"role_name": "hero", "color": "10,20,30"}
    roles[-1]["poses"][4:] = [None] * (steps - 4)
    plan = make_plan(
        tmp_path / "second",
        steps=steps,
        sensors=[sensor("CAM", "sensor.camera.rgb", pose={"z_m": 3.0})],
        scenario={"kind": "replay", "episode_id": "first", "actors": roles},
    )
    again = record(collector, plan, tmp_path / "second")
    assert again.header["spawned"] == first.header["spawned"]
    found = [i for i, a in sorted(again.actors().items()) if a.parent == 0]
    found = [i for i in found if again.actors()[i].type_id.startswith(("vehicle.", "walker."))]
    assert len(found) == len(users)
    assert again.actors()[again.header["ego_id"]].attributes["color"] == "10,20,30"
    for before, after in list(zip(users, found, strict=True))[:-1]:
        np.testing.assert_allclose(places(again, after), places(first, before), atol=0.01)
    ego, old = again.header["ego_id"], first.header["ego_id"]
    speeds = [frame.velocity[frame.row(ego)] for frame in world(again)]
    expected = np.diff(places(first, old), axis=0) / 0.1
    np.testing.assert_allclose(speeds[1:], expected, atol=0.02)
    alive = [set(frame.actor_id.tolist()) for frame in world(again)]
    assert [found[-1] in ids for ids in alive] == [tick < 4 for tick in range(steps)]
    assert collector.left_on_server() == GIVEN_BACK


def test_a_sensor_with_its_own_rate_is_off_in_between(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    plan = make_plan(tmp_path / "raw", steps=20, vehicles=EMPTY, pedestrians=NOBODY)
    spec = plan["episodes"][0]["spec"]
    spec["timing"]["sensor_sync"] = False
    slow = sensor("SLOW", "sensor.other.gnss")
    slow["attributes"] = {"sensor_tick": "0.5"}
    spec["sensors"] = [GNSS, slow]
    log = record(collector, plan, tmp_path / "raw")
    states = [row["sensors"]["SLOW"]["state"] for row in log.ledger()]
    assert set(states) == {"ok", "off"}
    assert 3 <= states.count("ok") <= 5
    assert {row["sensors"]["GNSS"]["state"] for row in log.ledger()} == {"ok"}
    segments = log.sealed_segments("SLOW")
    ticks = [record.tick for index in segments for record in log.read_segment("SLOW", index)]
    assert ticks == [tick for tick, state in enumerate(states) if state == "ok"]


SETTINGS = (
    "import carla, json, sys\n"
    "client = carla.Client('127.0.0.1', int(sys.argv[1])); client.set_timeout(20.0)\n"
    "world = client.get_world(); settings = world.get_settings()\n"
    "if len(sys.argv) > 2:\n"
    "    settings.max_substeps = 7; settings.max_culling_distance = 123.0\n"
    "    world.apply_settings(settings)\n"
    "print(json.dumps([settings.max_substeps, settings.max_culling_distance]))\n"
)


def server_settings(collector: Collector, *change: str) -> list[float]:
    command = [sys.executable, "-c", SETTINGS, str(collector.port), *change]
    done = subprocess.run(
        command, env=collector.environment, capture_output=True, timeout=END_S, check=True
    )
    found: list[float] = json.loads(done.stdout)
    return found


def test_ctrl_c_leaves_the_server_as_it_was_found(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    found = server_settings(collector, "change")
    assert found == [7, 123.0]
    process = collector.start(make_plan(tmp_path / "raw", steps=2000))
    collector.await_event(process, "segment_sealed")
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=END_S)
    assert process.returncode == 130
    assert collector.left_on_server() == GIVEN_BACK
    assert server_settings(collector) == found


def test_a_disk_that_refuses_leaves_a_clean_server(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    folder = tmp_path / "raw"
    process = collector.start(make_plan(folder, steps=2000))
    collector.await_event(process, "segment_sealed")
    # A stream's folder vanishes: its next segment cannot be made.
    (folder / "GNSS").rename(tmp_path / "elsewhere")
    output, _ = process.communicate(timeout=END_S)
    assert process.returncode == 1
    errors = [event for line in output.splitlines() if (event := json.loads(line))]
    assert any(event["event"] == "error" and event["kind"] == "recording" for event in errors)
    assert collector.left_on_server() == GIVEN_BACK


def test_a_starter_that_is_killed_leaves_a_clean_server(
    collector: Collector, make_plan: PlanMaker, tmp_path: Path
) -> None:
    plan = make_plan(tmp_path / "raw", steps=2000)
    plan["server"].update(port=collector.port, traffic_manager_port=free_port())
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(plan))
    code = (
        "import subprocess, sys\n"
        "command = [sys.executable, '-m', 'carstage.collector', sys.argv[1], '--exit-with-input']\n"
        "child = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL)\n"
        "print(child.pid, flush=True)\n"
        "child.wait()\n"
    )
    starter = subprocess.Popen(
        [sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE, env=collector.environment
    )
    assert starter.stdout is not None
    lines = iter(starter.stdout)
    assert int(next(lines)) > 0
    assert any(b"segment_sealed" in line for line in lines)
    starter.kill()
    starter.wait()
    # The pipe's last writer is the collector: its end is the collector's.
    rest = list(lines)
    starter.stdout.close()
    assert b'"exit_code": 130' in rest[-1]
    assert collector.left_on_server() == GIVEN_BACK
