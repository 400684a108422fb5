"""A small plan: every kind of sensor, little of each."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from running_collector import END_S, Collector

POSE = {"x_m": 0.5, "y_m": 0.0, "z_m": 1.7, "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0}
CAMERA = {"image_size_x": "96", "image_size_y": "54", "fov": "90.0"}
SWEEP = {
    "channels": "8",
    "points_per_second": "20000",
    "rotation_frequency": "10.0",
    "range": "60.0",
}
SENSORS = {
    "CAM": ("rgb", "sensor.camera.rgb", CAMERA),
    "CAM.depth": ("depth", "sensor.camera.depth", CAMERA),
    "SEMANTIC": ("semantic", "sensor.camera.semantic_segmentation", CAMERA),
    "CAM.instance": ("instance", "sensor.camera.instance_segmentation", CAMERA),
    "LIDAR": ("lidar", "sensor.lidar.ray_cast", SWEEP),
    "SEMANTIC_LIDAR": ("semantic_lidar", "sensor.lidar.ray_cast_semantic", SWEEP),
    "RADAR": ("radar", "sensor.other.radar", {"points_per_second": "1500"}),
    "FLOW": ("flow", "sensor.camera.optical_flow", CAMERA),
    "IMU": ("imu", "sensor.other.imu", {}),
    "GNSS": ("gnss", "sensor.other.gnss", {}),
}

SPEC: dict[str, Any] = {
    "spec_version": 1,
    "dialect": "0.9.16",
    "index": 0,
    "map": "Stage01",
    "weather": {"preset": "ClearNoon", "parameters": {"cloudiness": 12.5}, "lights": "auto"},
    "steps": 20,
    "fps": 10.0,
    "save_every": 1,
    "warmup_ticks": 6,
    "timing": {
        "mode": "sync",
        "sensor_sync": True,
        "max_substep_delta_time_s": 0.01,
        "max_substeps": 10,
        "on_incomplete": "wait",
    },
    "vehicles": {"count": 8, "filter": "vehicle.*"},
    "pedestrians": {"count": 4, "filter": "walker.pedestrian.*"},
    "traffic": {},
    "ego": {"blueprint": "vehicle.tesla.model3", "spawn_index": 3},
    "scenario": {"kind": "autopilot"},
    "sensors": [
        {
            "id": name,
            "kind": kind,
            "blueprint": blueprint,
            "hidden": "." in name,
            "labelled": name == "CAM",
            "pose": POSE,
            "attributes": attributes,
        }
        for name, (kind, blueprint, attributes) in SENSORS.items()
    ],
    "seeds": {
        "traffic_manager": 1,
        "walkers": 2,
        "spawn": 3,
        "ego": 4,
        "sensor_noise": 5,
        "driving": 6,
    },
}

PlanMaker = Callable[..., dict[str, Any]]


@pytest.fixture
def make_plan() -> PlanMaker:
    """Makes plans: one episode per folder; further keywords change the specification."""

    def make(
        *folders: Any, port: int = 2000, traffic_manager_port: int = 8000, **spec: Any
    ) -> dict[str, Any]:
        return copy.deepcopy(
            {
                "plan_version": 1,
                "server": {
                    "host": "127.0.0.1",
                    "port": port,
                    "timeout_s": 30.0,
                    "traffic_manager_port": traffic_manager_port,
                },
                "sensor_warmup_ticks": 3,
                "episodes": [
                    {
                        "episode_id": f"episode{index}",
                        "attempt": "a1",
                        "folder": str(folder),
                        "spec": {**SPEC, **spec},
                    }
                    for index, folder in enumerate(folders or ("raw",))
                ],
            }
        )

    return make


@pytest.fixture
def collector(simulator: Any, tmp_path: Path) -> Iterator[Collector]:
    home = tmp_path / "home"
    home.mkdir()
    made = Collector(simulator.port, tmp_path, home)
    yield made
    for process in made.processes:
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=END_S)
