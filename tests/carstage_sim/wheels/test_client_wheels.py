"""The unmodified wheels of all versions, each against the dialect of its version.

What each wheel does stands in programs beside this file, which run under its own interpreter.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
from pathlib import Path
from typing import Any

import pytest

import carstage
from client_wheels import wheel_python
from running_simulator import start_simulator, stop_simulator

pytestmark = pytest.mark.end_to_end

_PROGRAMS = Path(__file__).parent
_SOURCES = str(Path(carstage.__file__).parents[1])
_END_S = 120.0

_KINDS = {
    "sensor.camera.rgb": "Image",
    "sensor.camera.depth": "Image",
    "sensor.camera.semantic_segmentation": "Image",
    "sensor.camera.instance_segmentation": "Image",
    "sensor.camera.normals": "Image",
    "sensor.camera.optical_flow": "OpticalFlowImage",
    "sensor.lidar.ray_cast": "LidarMeasurement",
    "sensor.lidar.ray_cast_semantic": "SemanticLidarMeasurement",
    "sensor.lidar.ray_cast_sweeping": "SemanticLidarMeasurement",
    "sensor.lidar.ray_cast_flash": "SemanticLidarMeasurement",
    "sensor.other.radar": "RadarMeasurement",
    "sensor.other.imu": "IMUMeasurement",
    "sensor.other.gnss": "GnssMeasurement",
    "sensor.other.occupancy": "SemanticLidarMeasurement",
    "sensor.other.radar_rcs": "SemanticLidarMeasurement",
}


def run(program: str, version: str, tmp_path: Path) -> Any:
    """What a program finds under the wheel of a version, on a server of that version."""
    python = wheel_python(version)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        tm_port = probe.getsockname()[1]
    found = tmp_path / "found.json"
    simulator = start_simulator(
        tmp_path / "server.log", "--exit-with-parent", "--protocol", version
    )
    try:
        done = subprocess.run(
            [
                python,
                "-X",
                "faulthandler",
                _PROGRAMS / program,
                str(simulator.port),
                str(tm_port),
                found,
            ],
            env={"PATH": os.environ["PATH"], "HOME": str(tmp_path), "PYTHONPATH": _SOURCES},
            capture_output=True,
            text=True,
            timeout=_END_S,
            check=False,
        )
    finally:
        stop_simulator(simulator)
    log = (tmp_path / "server.log").read_text()
    assert done.returncode == 0, f"{done.stderr[-4000:]}\n{log[-4000:]}"
    unexpected = [line for line in log.splitlines() if "no map 'Nowhere' was found" not in line]
    assert unexpected == []
    return json.loads(found.read_text())


def check(version: str, found: dict[str, Any]) -> None:
    """What must hold on every version; labels are checked by name here."""
    assert found["versions"] == [version, version]
    assert found["map"][0] == "Carla/Maps/Stage01"
    assert found["map"][1] > 100
    assert found["weather"] == [12.5, 33.0, 0.0]
    assert (found["library"]["wheels"], found["library"]["fov"]) == (4, 90.0)
    assert found["loads"] == {
        "episodes": [2, 3, 4],
        "vehicles_left": [0, 0, 0],
        "frames": [1, 1, 1],
        "synchronous": True,
        "refused": "map not found",
    }
    scenery = found["scenery"]
    assert scenery["building_boxes"] == scenery["buildings"] > 0
    assert (scenery["kinds_of_poles"], scenery["road"][0]) == (["Poles"], "Roads")
    buffers = {"SceneDepth": [96, 64, 255], "SSAO": [96, 64, 0]}
    assert found["gbuffers"] == ({} if version == "0.9.13" else buffers)
    check_drive(found["drive"], set(found["library"]["sensors"]))
    check_batch(found["batch"])


def check_drive(found: dict[str, Any], offered: set[str]) -> None:
    """The Traffic Manager drives, the walker walks, every frame of every sensor comes."""
    assert found["wrong_frames"] == []
    assert found["kinds"] == {name: kind for name, kind in _KINDS.items() if name in offered}
    assert min(found["speeds"][:2]) > 1.0
    assert 1.0 < found["speeds"][2] < 1.6
    assert found["limit"] > 0.0
    assert found["points"] > 0
    assert found["gravity"] == pytest.approx(9.81, abs=0.5)
    assert found["globe"]["sensor"] == pytest.approx(found["globe"]["client"], abs=1e-9)
    assert all(found["destroyed"])
    assert found["left"] == []


def check_batch(found: dict[str, Any]) -> None:
    """Every command did what its name says and nothing else."""
    collision = "Spawn failed because of collision at spawn position"
    assert found["spawn_errors"] == ["", collision, ""]
    assert found["throttled"][0] == 1.0
    assert found["throttled"][1] > 1.0
    assert found["errors"] == []
    assert (found["mass"], found["lights"]) == (1234.0, 128)
    assert found["car_speed"] == pytest.approx(4.0, abs=0.3)
    assert found["car_moved_to"] < 0.5
    assert found["walker_moved_to"] < 1.0
    assert found["walker_speed"] == 1.5
    assert found["left"] == []


def check_labels(found: dict[str, Any], *, buildings: int, roads: int, sky: int, car: int) -> None:
    """The numbers that pictures, points and actors carry."""
    seen = found["drive"]["seen"]
    assert {buildings, roads, sky, car} <= set(seen["semantic"])
    assert seen["instance"] == seen["semantic"]
    assert {roads, car} <= set(seen["lidar"])
    assert found["drive"]["tags"]["car"] == [car]
    kind, with_the_other, tags, impulse = found["drive"]["collision"]
    assert (kind, with_the_other, tags) == ("CollisionEvent", True, [car])
    assert impulse > 100.0


def test_wheel_0_9_13_drives_and_records(tmp_path: Path) -> None:
    found = run("drive.py", "0.9.13", tmp_path)
    check("0.9.13", found)
    check_labels(found, buildings=1, roads=7, sky=13, car=10)
    assert found["drive"]["tags"]["walker"] == [4]
    assert max(found["drive"]["seen"]["semantic"]) <= 22
    assert "sensor.camera.normals" not in found["library"]["sensors"]
    assert found["batch"]["commands"] == 14  # Ackermann control came later


def check_since_0_9_14(version: str, tmp_path: Path) -> None:
    """What the three later versions have in common."""
    found = run("drive.py", version, tmp_path)
    check(version, found)
    check_labels(found, buildings=3, roads=1, sky=11, car=14)
    assert found["drive"]["tags"]["walker"] == [12]
    assert "sensor.camera.normals" in found["library"]["sensors"]
    assert found["batch"]["commands"] == 15


def test_wheel_0_9_14_drives_and_records(tmp_path: Path) -> None:
    check_since_0_9_14("0.9.14", tmp_path)


def test_wheel_0_9_15_drives_and_records(tmp_path: Path) -> None:
    check_since_0_9_14("0.9.15", tmp_path)


def test_wheel_0_9_16_drives_and_records(tmp_path: Path) -> None:
    check_since_0_9_14("0.9.16", tmp_path)


@pytest.mark.parametrize("version", ["0.9.13", "0.9.15"])
def test_wheel_loads_while_its_traffic_manager_runs_freely(version: str, tmp_path: Path) -> None:
    # 0.9.16 opens a new episode and has a test of its own, in test_real_client_end_to_end.py.
    assert min(run("reload.py", version, tmp_path)) > 0.5
