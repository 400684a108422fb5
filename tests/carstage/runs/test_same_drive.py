"""One drive, recorded by a run and again by ``record`` beside a program of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pytest

import carstage
import same_drive_program
from carstage.config import check_config
from carstage.dataset import Episode, Sensor
from carstage.rawlog.reader import EpisodeLog
from carstage.runs import record_beside
from carstage.runs.events import OtherEvent, RunEvent
from running_simulator import RunningSimulator

pytestmark = pytest.mark.xdist_group("following")  # recorded once

WARM_UP, FRAMES = 8, 12
DRIVE: dict[str, Any] = {
    "seed": 5,
    "map": {"choice": "Stage01"},
    # Lights that change are asked for apart from the frames: who follows may get later ones.
    "weather": {"choice": "ClearNoon", "lights": "on"},
    "vehicles": {"count": 3},
    "pedestrians": {"count": 0},
    "fps": 10,
    "duration_s": FRAMES / 10,
    "timing": {"warmup_ticks": WARM_UP},
    "image_size": [64, 36],
    "labels": {"method": "both"},
    "min_lidar_points": 0,
    "conversion": {"workers": 1},
    "output": {"keep_raw": True},
    "rig": {
        "sensors": [
            {"id": "CAM", "kind": "rgb", "pose": {"x": 1.5, "z": 1.6}},
            {"id": "INSTANCE", "kind": "instance", "pose": {"x": 1.5, "z": 1.6}},
            {"id": "DEPTH", "kind": "depth", "pose": {"x": 1.5, "z": 1.6}},
            {
                "id": "LIDAR",
                "kind": "lidar",
                "pose": {"z": 2.2},
                "attributes": {"channels": 8, "points_per_second": 20000, "noise_stddev": 0.02},
            },
            {"id": "IMU", "kind": "imu", "attributes": {"noise_accel_stddev_x": 0.1}},
            {"id": "GNSS", "kind": "gnss"},
            {"id": "RADAR", "kind": "radar", "pose": {"x": 2.2, "z": 1.0}},
        ]
    },
}
OF_THE_EPISODE = {"k", "tick", "timestamp_s", "episode_id", "instance_uid"}
"""Columns that say which episode and which frame of it; all others are of the world."""


class Drives(NamedTuple):
    """The same world recorded twice."""

    run: Episode
    beside: Episode


@pytest.fixture(scope="module")
def drives(simulator: RunningSimulator, tmp_path_factory: pytest.TempPathFactory) -> Drives:
    folder = tmp_path_factory.mktemp("same-drive")
    at = {"kind": "remote", "host": simulator.host, "port": simulator.port}
    assert carstage.run({**DRIVE, "server": at}, folder / "run").state == "done"
    (run,) = carstage.Dataset(folder / "run").episodes
    (folder / "scene.json").write_text(json.dumps(scene_of(run, folder / "run")))
    program = subprocess.Popen(
        [
            *(sys.executable, same_drive_program.__file__, simulator.host, str(simulator.port)),
            str(folder / "scene.json"),
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert program.stdin is not None
    assert program.stdout is not None

    def on_event(event: RunEvent) -> None:
        if isinstance(event, OtherEvent) and event.name == "following":
            program.stdin.write("go\n")
            program.stdin.flush()

    try:
        ego_id = program.stdout.readline().strip()
        address = f"{simulator.host}:{simulator.port}"
        config = check_config(DRIVE)
        record_beside(address, ego_id, config, folder / "beside", on_event, episodes=1)
        program.communicate(timeout=120.0)
    finally:
        program.kill()
        program.communicate()
    assert program.returncode == 0
    (beside,) = carstage.Dataset(folder / "beside").episodes
    return Drives(run, beside)


def scene_of(run: Episode, out: Path) -> dict[str, Any]:
    """What a program has to know to make the world of a recorded run again."""
    spec = run.spec
    (raw,) = out.glob("runs/*/raw/*/*")
    log = EpisodeLog(raw)
    actors, first = log.actors(), log.world_frames(0)[0]
    return {
        "map": spec.map,
        "step_s": spec.step_s,
        "max_substep_s": spec.timing.max_substep_delta_time_s,
        "max_substeps": spec.timing.max_substeps,
        "weather": first.meta["weather"],
        "traffic_manager_seed": spec.seeds.traffic_manager,
        "lights": first.meta["vehicle_lights"],
        "ticks": WARM_UP + FRAMES,
        "cars": [
            {
                "blueprint": actor.type_id,
                "attributes": dict(actor.attributes),
                "near": [float(x) for x in first.location[first.row(actor.id)]],
            }
            for actor in sorted(actors.values(), key=lambda actor: actor.id)
            if actor.type_id.startswith("vehicle.")
        ],
    }


def frames(episode: Episode) -> dict[int, int]:
    """Index of each saved frame, by the server's number of it."""
    return {row["server_frame"]: row["k"] for row in episode.ledger().to_pylist()}


def rows(table: pa.Table, numbers: dict[int, int]) -> dict[int, list[dict[str, Any]]]:
    """What a table says of the world, by the server's frame."""
    names = [name for name in table.column_names if name not in OF_THE_EPISODE]
    server_frames = {k: frame for frame, k in numbers.items()}
    found: dict[int, list[dict[str, Any]]] = {frame: [] for frame in numbers}
    for row in table.to_pylist():
        found[server_frames[row["k"]]].append({name: row[name] for name in names})
    return found


def content(sensor: Sensor, k: int) -> list[bytes]:
    """What a sensor gave: its files, or its row of a table."""
    paths = sensor.paths(k)
    if paths[0].suffix == ".parquet":
        return [sensor.read(k).tobytes()]
    return [path.read_bytes() for path in paths]


def test_every_frame_of_the_run_is_in_the_recording(drives: Drives) -> None:
    run, beside = frames(drives.run), frames(drives.beside)
    assert len(run) == FRAMES
    assert set(run) <= set(beside)
    assert max(run) == max(beside)
    for episode in drives:
        states = [name for name in episode.ledger().column_names if name.endswith(".state")]
        assert {row[name] for row in episode.ledger().to_pylist() for name in states} == {"ok"}


def test_the_first_frame_tells_of_traffic_lights_as_the_next_one_does(drives: Drives) -> None:
    told = [
        {row["track_id"] for row in found if row["traffic_light_state"] is not None}
        for _, found in sorted(rows(drives.beside.objects(), frames(drives.beside)).items())
    ]
    assert told[0]
    assert told[0] == told[1]


@pytest.mark.parametrize("name", ["ego", "objects", "camera_objects", "sensor_poses"])
def test_labels_are_equal(drives: Drives, name: str) -> None:
    run, beside = (
        rows(getattr(episode, name)(), frames(episode)) for episode in (drives.run, drives.beside)
    )
    assert any(run.values())
    for frame, expected in run.items():
        assert beside[frame] == expected, f"frame {frame}"


@pytest.mark.parametrize("sensor", [one["id"] for one in DRIVE["rig"]["sensors"]])
def test_sensors_gave_the_same_bytes(drives: Drives, sensor: str) -> None:
    expected, found = drives.run.sensor(sensor), drives.beside.sensor(sensor)
    in_the_run, in_the_recording = frames(drives.run), frames(drives.beside)
    for frame, k in in_the_run.items():
        assert content(expected, k) == content(found, in_the_recording[frame]), f"frame {frame}"


def test_the_rig_and_the_map_are_described_alike(drives: Drives) -> None:
    run, beside = drives
    described, same = (
        json.loads((episode.folder / "calibration.json").read_bytes()) for episode in drives
    )
    assert described == same
    assert beside.opendrive() == run.opendrive()
    assert beside.geo_frame == run.geo_frame
