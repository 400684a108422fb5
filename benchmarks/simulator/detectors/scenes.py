"""The drives whose pictures detectors look at."""

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


def configuration(pictures: int = PICTURES, seed: int = 25) -> dict[str, Any]:
    """What to record: pictures of 1280x720 in three towns and four weathers, two seconds apart.

    Args:
        pictures: as many of each town in each weather as make these, rounded up.
        seed: of the traffic and of the ego's ways.
    """
    each = -(-pictures // (len(_TOWNS) * len(_WEATHERS)))
    camera = {
        "id": "CAM",
        "kind": "rgb",
        "pose": {"x": 1.5, "z": 1.6},
        "attributes": {"image_size": [1280, 720]},
    }
    groups = [{"count": count, "base_type": kind} for kind, count in _GROUPS.items()]
    return {
        "name": "detectors",
        "seed": seed,
        "duration_s": 2 * each,
        "fps": 10,
        "save_every": 20,
        "max_distance_m": 150,
        "map": {"choice": list(_TOWNS)},
        "weather": {"choice": _WEATHERS["noon"]},
        "vehicles": {"count": 20, "radius_m": 80, "groups": groups},
        "pedestrians": {"count": 40, "radius_m": 60, "crossing_percent": 20},
        "rig": {"sensors": [camera]},
        "campaign": {"method": "grid"},
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
        seed: of the traffic and of the ego's ways.

    Raises:
        RuntimeError: recording failed; with the end of what it said.
    """
    folder.mkdir(parents=True, exist_ok=True)
    return record(configuration(pictures, seed), folder)
