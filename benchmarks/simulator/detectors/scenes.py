"""The places whose pictures detectors look at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.framework.recorded import record

RAIN = "rain"
PICTURES = 120
_TOWNS = ("Stage01", "Stage02", "Stage03")
_WEATHERS = {
    "noon": "ClearNoon",
    "clouds": "CloudyNoon",
    "sunset": "ClearSunset",
    RAIN: "MidRainyNoon",
}
_GROUPS = {"bus": 3, "truck": 4, "motorcycle": 5, "bicycle": 5}
_OTHERS = (
    "vehicle.audi.etron", "vehicle.seat.leon", "vehicle.nissan.patrol_2021",
    "vehicle.mercedes.coupe_2020",
)  # fmt: skip
"""Cars near the ego that carry a camera, too: few pictures show the same."""
_WARMUP_TICKS = 60
"""Of 0.1 s: vehicles are on their way then, and walkers walk."""


def configuration(pictures: int = PICTURES, seed: int = 25) -> dict[str, Any]:
    """What to record: pictures of 1280x720 from five cars at places in three towns and weathers.

    Each place is seen at one moment, the same in all weathers.

    Args:
        pictures: as many places of each town as make these, rounded up.
        seed: of the places and of the traffic.
    """
    each = -(-pictures // (len(_TOWNS) * len(_WEATHERS) * (1 + len(_OTHERS))))
    camera = {
        "id": "CAM",
        "kind": "rgb",
        "pose": {"x": 1.5, "z": 1.6},
        "attributes": {"image_size": [1280, 720]},
    }
    rig = {"sensors": [camera]}
    groups = [{"count": count, "base_type": kind} for kind, count in _GROUPS.items()]
    return {
        "name": "detectors",
        "seed": seed,
        "duration_s": 0.1,
        "fps": 10,
        "timing": {"warmup_ticks": _WARMUP_TICKS},
        "max_distance_m": 150,
        "map": {"choice": list(_TOWNS)},
        "weather": {"choice": _WEATHERS["noon"]},
        "vehicles": {"count": 20, "radius_m": 80, "groups": groups},
        "pedestrians": {"count": 40, "radius_m": 60, "crossing_percent": 20},
        "rig": rig,
        "agents": [
            {"name": blueprint.split(".")[-1], "blueprint": blueprint, "rig": rig}
            for blueprint in _OTHERS
        ],
        "campaign": {"method": "grid", "repeats": each},
        "variants": {
            name: {"weather": {"choice": preset}} if name != "noon" else {}
            for name, preset in _WEATHERS.items()
        },
    }


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
