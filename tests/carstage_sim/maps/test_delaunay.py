"""One triangulation whatever one begins with, and areas made narrower, without GEOS's choices."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage_sim.maps.delaunay import delaunay
from carstage_sim.maps.shrinking import shrunk


def _grid(size: int) -> NDArray[np.int64]:
    """A square lattice: every cell's four corners lie on one circle."""
    return np.array([(x, y) for x in range(size) for y in range(size)], dtype=np.int64) * 250


def _any_triangulation(points: NDArray[np.int64], slant: float) -> NDArray[np.int64]:
    """One that depends on ``slant``: GEOS's of the sheared points."""
    sheared = np.stack([points[:, 0] + slant * points[:, 1], points[:, 1]], axis=1)
    triangles = shapely.get_parts(shapely.delaunay_triangles(shapely.multipoints(sheared)))
    corners = np.array([np.array(t.exterior.coords)[:3] for t in triangles])
    index = np.linalg.norm(corners[:, :, None] - sheared, axis=-1).argmin(axis=-1)
    (ax, ay), (bx, by), (cx, cy) = (points[index[:, k]].T for k in range(3))
    turn = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    assert (turn != 0).all()
    counter_clockwise: NDArray[np.int64] = np.where((turn < 0)[:, None], index[:, ::-1], index)
    return counter_clockwise


def _in_circle(a: list[int], b: list[int], c: list[int], d: list[int]) -> int:
    """The determinant in Python's whole numbers, by its definition."""
    (ax, ay), (bx, by), (cx, cy) = ([p[0] - d[0], p[1] - d[1]] for p in (a, b, c))
    return (
        (ax * ax + ay * ay) * (bx * cy - cx * by)
        - (bx * bx + by * by) * (ax * cy - cx * ay)
        + (cx * cx + cy * cy) * (ax * by - bx * ay)
    )


@pytest.mark.parametrize("points", [_grid(5), _grid(5) * 40 + 3_000_000])
def test_every_first_triangulation_gives_the_same_triangles(points: NDArray[np.int64]) -> None:
    starts = [_any_triangulation(points, slant) for slant in (-0.9, -0.1, 0.1, 0.3, 0.8, 2.1)]
    assert len({tuple(map(tuple, np.sort(start, axis=1).tolist())) for start in starts}) > 1
    face = np.zeros(len(starts[0]), dtype=np.int64)
    found = [delaunay(points, start, face)[0] for start in starts]
    for one, other in pairwise(found):
        np.testing.assert_array_equal(one, other)


def test_no_point_lies_in_the_circle_of_a_triangle() -> None:
    rng = np.random.default_rng(7)
    points = np.unique(rng.integers(0, 60, (80, 2)), axis=0) * 1000
    start = _any_triangulation(points, 2.3)
    found, _ = delaunay(points, start, np.zeros(len(start), dtype=np.int64))
    numbers = points.tolist()
    for a, b, c in found.tolist():
        for d in range(len(numbers)):
            assert _in_circle(numbers[a], numbers[b], numbers[c], numbers[d]) <= 0


def test_edges_between_faces_stay() -> None:
    points = np.array([(0, 0), (0, 10), (1, 5), (9, 5)], dtype=np.int64)[[0, 1, 2, 3]]
    tall = np.array([[0, 2, 1], [0, 3, 2]], dtype=np.int64)
    apart, face = delaunay(points, tall, np.array([0, 1]))
    assert apart.tolist() == [[0, 2, 1], [0, 3, 2]]
    assert face.tolist() == [0, 1]


def test_a_flat_triangle_disappears() -> None:
    points = np.array([(0, 0), (5, 0), (5, 9), (10, 0)], dtype=np.int64)
    drawn = np.array([[0, 1, 3], [0, 3, 2]], dtype=np.int64)  # the first one has no area
    found, _ = delaunay(points, drawn, np.zeros(2, dtype=np.int64))
    assert found.tolist() == [[0, 1, 2], [1, 3, 2]]


def test_a_court_stays_a_hole_when_the_ring_round_it_gets_narrower() -> None:
    outer = shapely.Point(0.0, 0.0).buffer(20.0, quad_segs=25)
    ring = outer.difference(shapely.Point(0.0, 0.0).buffer(17.0, quad_segs=25))
    narrow = shrunk(ring, 0.02)
    assert len(narrow.interiors) == 1
    assert narrow.area == pytest.approx(ring.area - 0.02 * ring.length, rel=1e-4)


def _are_one(found: BaseGeometry, expected: BaseGeometry) -> bool:
    return bool(found.symmetric_difference(expected).area < 1e-9)


def test_corners_stay_pointed_and_thin_parts_go() -> None:
    assert _are_one(shrunk(shapely.box(0, 0, 4, 4), 0.5), shapely.box(0.5, 0.5, 3.5, 3.5))
    notched = shapely.box(0, 0, 4, 4).difference(shapely.box(2, 2, 4, 4))
    expected = shapely.box(0.5, 0.5, 3.5, 3.5).difference(shapely.box(1.5, 1.5, 4, 4))
    assert _are_one(shrunk(notched, 0.5), expected)
    assert shrunk(shapely.box(0, 0, 4, 0.8), 0.5).is_empty
    assert shrunk(shapely.Polygon(), 0.5).is_empty
