"""Datasets that nobody damaged: does ``carstage validate`` find nothing in them?

Three towns, day and night, sun and rain; sensors on the car, on a drone that follows it, and fixed
on the map. Each is recorded anew and validated; every problem, a warning too, counts.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from itertools import cycle, islice, product
from pathlib import Path
from typing import Any

from benchmarks.framework.recorded import record
from carstage.bench.verdict import Figure, Verdict
from carstage.validation import validate_dataset

DATASETS = 20
_TOWNS = ("Stage01", "Stage02", "Stage03")
_WEATHERS = ("ClearNoon", "ClearNight", "HardRainNoon", "ClearSunset", "CloudyNoon", "WetNight")
_CAMERAS = ("rgb", "depth", "semantic", "instance", "flow")
_DRONE = {"attach_to": "ego", "attachment": "follow"}
_MAST = {"x": 0.0, "y": 0.0, "z": 12.0, "pitch_deg": -30.0}
_EXTRAS = ("car", "drone", "fixed")


def _rig(extra: str) -> list[dict[str, Any]]:
    """A whole set of cameras on the car, a LiDAR and the like, and one more view."""
    front = {"x": 1.5, "z": 1.6}
    sensors: list[dict[str, Any]] = [
        {"id": kind.upper(), "kind": kind, "pose": front} for kind in _CAMERAS
    ]
    sensors += [
        {"id": "LIDAR", "kind": "lidar", "pose": {"z": 1.9}, "attributes": {"channels": 32}},
        {"id": "RADAR", "kind": "radar", "pose": {"x": 2.2, "z": 0.7}},
        {"id": "IMU", "kind": "imu"},
        {"id": "GNSS", "kind": "gnss", "pose": {"z": 1.8}},
    ]
    if extra == "drone":
        above = {"x": -8.0, "z": 6.0, "pitch_deg": -15.0}
        sensors.append({"id": "DRONE", "kind": "rgb", "pose": above, **_DRONE})
    if extra == "fixed":
        sensors.append({"id": "MAST", "kind": "rgb", "pose": _MAST, "attach_to": "world"})
    return sensors


def _configs(count: int) -> Iterator[dict[str, Any]]:
    """The first so many combinations, each with a seed of its own."""
    combined = product(_WEATHERS, zip(_TOWNS, _EXTRAS, strict=True))
    shifted = ((w, (town, _EXTRAS[(i + i // 3) % 3])) for i, (w, (town, _)) in enumerate(combined))
    for seed, (weather, (town, extra)) in enumerate(islice(cycle(list(shifted)), count)):
        yield {
            "name": f"{town}, {weather}, {extra}",
            "seed": seed,
            "map": town,
            "weather": {"choice": weather},
            "duration_s": 1.0,
            "fps": 10,
            "vehicles": {"count": 15},
            "pedestrians": {"count": 20},
            "image_size": [240, 135],
            "timing": {"warmup_ticks": 25},
            "conversion": {"workers": 1},
            "server": {"kind": "embedded", "self_test": "off"},
            "rig": {"sensors": _rig(extra)},
        }


def measure_undamaged(
    datasets: int = DATASETS,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Record so many datasets and validate each.

    Args:
        datasets: how many.
        progress: called with those done and their total number.
    """
    notes: list[str] = []
    errors = warnings = undecidable = 0
    with tempfile.TemporaryDirectory(prefix="carstage-undamaged-") as scratch:
        for number, config in enumerate(_configs(datasets), start=1):
            folder = Path(scratch) / str(number)
            folder.mkdir()
            report = validate_dataset(record(config, folder))
            errors += sum(count["error"] for count in report.counts.values())
            warnings += sum(count["warning"] for count in report.counts.values())
            undecidable += len(report.figures["not_decidable"])
            notes += [
                f"{config['name']}: {problem.check}, frame {problem.frame}, {problem.message}"
                for problem in report.problems[:5]
            ]
            progress(number, datasets)
    return Verdict(
        "undamaged",
        (
            Figure("datasets", datasets, ">=", 1),
            Figure("errors", errors, "==", 0),
            Figure("warnings", warnings),
            Figure("not_decidable", undecidable),
        ),
        notes,
    )
