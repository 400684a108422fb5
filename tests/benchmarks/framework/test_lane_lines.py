"""Which pixels an outline explains: those that it covers, and those within three of it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from benchmarks.framework.lane_lines import explained_pixels
from carstage.geometry import intrinsics, pose_matrix

WIDTH, HEIGHT = 200, 100
K = intrinsics(WIDTH, HEIGHT, 90.0)
ROAD_LINE, ROAD = 24, 1


def episode(row: dict[str, Any], tags: np.ndarray, depth_m: float) -> Any:
    frame = SimpleNamespace(
        k=0,
        read={"SEMANTIC": tags, "DEPTH": np.full((HEIGHT, WIDTH), depth_m, np.float32)}.get,
        world_from_sensor=lambda _: pose_matrix([0.0, 0.0, 1.5], [0.0, 0.0, 0.0]),
    )
    return SimpleNamespace(
        lane_lines=lambda: pa.Table.from_pylist([row]),
        sensor=lambda _: SimpleNamespace(calibration=SimpleNamespace(k=K)),
        iter_frames=lambda: [frame],
    )


def line(kind: str, x: list[float], z: list[float], width: float) -> dict[str, Any]:
    return {"k": 0, "kind": kind, "width": width, "x": x, "y": [1.5] * len(x), "z": z}


def columns(row: dict[str, Any], depth_m: float = 10.0) -> list[int]:
    """Columns of the picture's row at 10 m ahead that are explained."""
    tags = np.full((HEIGHT, WIDTH), ROAD, np.uint8)
    tags[65] = ROAD_LINE  # 50 + 100 * 1.5 / 10
    (found,) = explained_pixels(episode(row, tags, depth_m))
    return np.flatnonzero(found).tolist()


def test_a_marking_explains_its_width_and_three_pixels_beside() -> None:
    # 0.4 m at 10 m are 4 px, around the middle of the picture.
    found = columns(line("marking", [0.0, 0.0], [5.0, 20.0], 0.4))
    assert found == list(range(95, 105))


@pytest.mark.parametrize("kind", ["crosswalk", "painted_object"])
def test_an_area_explains_what_lies_in_it(kind: str) -> None:
    found = columns(line(kind, [-1.0, 1.0, 1.0, -1.0], [5.0, 5.0, 20.0, 20.0], 0.0))
    assert set(range(90, 110)) <= set(found) <= set(range(86, 114))


def test_a_boundary_explains_nothing_and_far_pixels_do_not_count() -> None:
    assert columns(line("boundary", [0.0, 0.0], [5.0, 20.0], 0.0)) == []
    assert columns(line("marking", [0.0, 0.0], [5.0, 20.0], 0.4), depth_m=41.0) == []
