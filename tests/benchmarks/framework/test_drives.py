"""The drives that benchmarks of surroundings are measured on can be planned."""

from __future__ import annotations

from pathlib import Path

import pytest

import benchmarks
from carstage.config import load_config

DRIVES = Path(benchmarks.__file__).parent / "drives"


@pytest.mark.parametrize("name", ["birds-eye", "exact-occupancy", "occupancy"])
def test_a_drive_has_what_its_benchmark_looks_at(name: str) -> None:
    config = load_config(DRIVES / f"{name}.yaml")
    labels = config.labels
    asked = labels.birds_eye if name == "birds-eye" else labels.occupancy
    assert asked is not None
    if labels.occupancy is not None:
        assert labels.occupancy.exact is (name == "exact-occupancy")
    assert {"rgb", "depth", "lidar"} <= {sensor.kind for sensor in config.sensors}
    commands = (DRIVES / f"{name}.yaml").read_text("utf-8")
    assert f"python -m benchmarks {name} " in commands
