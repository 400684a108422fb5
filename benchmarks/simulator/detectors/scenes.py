"""The places whose pictures detectors look at."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.framework.recorded import record

CAMERA = "CAM"
RAIN = "MidRainyNoon"
PICTURES = 120
_TOWNS = ("Stage01", "Stage02", "Stage03")
_WEATHERS = ("ClearNoon", "CloudyNoon", "ClearSunset", RAIN)
_MIX = (
    ("car", 3), ("bicycle", 1), ("truck", 1), ("car", 2), ("motorcycle", 1), ("bus", 1),
    ("car", 2), ("bicycle", 1), ("car", 1), ("truck", 1),
)  # fmt: skip
"""Vehicles by base type in the order in which they get places: near ones of the ego first."""
_MIXES = 3
_EGOS = (
    "vehicle.tesla.model3", "vehicle.audi.a2", "vehicle.toyota.prius", "vehicle.nissan.micra",
    "vehicle.bmw.grandtourer", "vehicle.lincoln.mkz_2020", "vehicle.ford.mustang",
    "vehicle.citroen.c3",
)  # fmt: skip
_AHEAD = {"x": 1.5, "z": 1.6}
_CARS = {
    "vehicle.nissan.patrol_2021": {"x": 0.8, "y": -1.15, "z": 1.6, "yaw_deg": -45.0},
    "vehicle.mercedes.coupe_2020": {"x": -2.45, "z": 1.6, "yaw_deg": 180.0},
}
"""Cars near the ego with a camera, too, and its pose: to the left (at the mirror), and back."""
_EYE_M, _NARROW_DEG = 1.7, 50.0
"""Height of who stands, and the field of view of the camera at the junction; others have 90."""
_CORNER = {"name": "corner", "kind": "junction", "height_m": _EYE_M}
_ACROSS = {
    "name": "across",
    "kind": "drone",
    "path": {"kind": "follow", "x": 1.0, "y": -7.0, "height_m": _EYE_M},
    "gimbal": {"look_at": "ego"},
}
"""Who stands at the next junction, and who stands across the street and looks at the ego.

Cars that follow each other in lanes do not see each other from the side.
"""
_VIEWS = 3 + len(_CARS)
_LABELS_M = 500
"""As far as a detector finds cars: those without a label would be off class."""
_WARMUP_TICKS = 60
"""Of 0.1 s: vehicles are on their way then, and walkers walk."""


def configuration(pictures: int = PICTURES, seed: int = 25) -> dict[str, Any]:
    """What to record: five pictures of 1280x720 at each place, in three towns and four weathers.

    Each place has one weather and is seen at one moment: no two places show the same traffic.

    Args:
        pictures: as many places of each town and weather as make these, rounded up.
        seed: of the places and of the traffic.
    """
    each = -(-pictures // (len(_TOWNS) * len(_WEATHERS) * _VIEWS))
    groups = [{"count": count, "base_type": kind} for kind, count in _MIX * _MIXES]
    return {
        "name": "detectors",
        "seed": seed,
        "duration_s": 0.1,
        "fps": 10,
        "timing": {"warmup_ticks": _WARMUP_TICKS},
        "max_distance_m": _LABELS_M,
        "map": {"choice": list(_TOWNS)},
        "weather": {"choice": list(_WEATHERS)},
        "vehicles": {"count": 10, "radius_m": 70, "groups": groups},
        "pedestrians": {"count": 40, "radius_m": 60, "crossing_percent": 20},
        "rig": _rig(_AHEAD),
        "agents": [
            *(
                {"name": blueprint.split(".")[-1], "blueprint": blueprint, "rig": _rig(pose)}
                for blueprint, pose in _CARS.items()
            ),
            {**_CORNER, "rig": _rig({}, _NARROW_DEG)},
            {**_ACROSS, "rig": _rig({})},
        ],
        "ego": {"blueprint": {"choice": list(_EGOS)}},
        "campaign": {
            "method": "stratified",
            "strata": ["map.choice", "weather.choice"],
            "repeats": each,
        },
    }


def _rig(pose: Mapping[str, float], fov_deg: float = 90.0) -> dict[str, Any]:
    """One camera."""
    camera = {
        "id": CAMERA,
        "kind": "rgb",
        "pose": dict(pose),
        "attributes": {"image_size": [1280, 720], "fov": fov_deg},
    }
    return {"sensors": [camera]}


def record_scenes(folder: Path, pictures: int = PICTURES, seed: int = 25) -> Path:
    """Record what is not recorded yet; the dataset's folder.

    Args:
        folder: gets the dataset; made if missing.
        pictures: in all.
        seed: of the places and of the traffic.

    Raises:
        RuntimeError: recording failed; with the end of what it said.
    """
    folder.mkdir(parents=True, exist_ok=True)
    return record(configuration(pictures, seed), folder)
