"""The laser of each point, where a kind of LiDAR keeps it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from carstage.exporters import clouds
from carstage.sensor_kinds.model import Column

NAMES = ("x", "y", "z", "intensity")


@pytest.mark.parametrize(
    ("more", "found"),
    [(("ring", "time_s"), 4), (("time_s", "ring"), 5), (("time_s", "echo"), None)],
)
def test_a_ring_is_found_by_its_column(
    monkeypatch: pytest.MonkeyPatch, more: tuple[str, ...], found: int | None
) -> None:
    kind = SimpleNamespace(columns=[Column(name, "<f4") for name in (*NAMES, *more)])
    monkeypatch.setattr(clouds, "sensor_kind", lambda name: kind)
    points = np.arange(12, dtype=np.float32).reshape(2, 6)
    lidar = SimpleNamespace(kind="of another package")
    episode = SimpleNamespace(sensor=lambda name: lidar)
    frame: Any = SimpleNamespace(episode=episode, read=lambda name: points)
    rings = clouds.read_rings(frame, "LIDAR")
    if found is None:
        assert rings is None
    else:
        assert rings is not None
        assert rings.tolist() == points[:, found].tolist()
