"""Height of the ground under a point: what walkers and wheels stand on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.town import Town

_GROUND_TAGS = (
    CityObjectLabel.ROADS,
    CityObjectLabel.ROAD_LINES,
    CityObjectLabel.SIDEWALKS,
    CityObjectLabel.TERRAIN,
    CityObjectLabel.GROUND,
)
_CELL_M = 4.0
_EDGE = 1e-9

GroundHeight = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def ground_height(town: Town) -> GroundHeight:
    """A function from ``(N, 2)`` or ``(N, 3)`` places (m) to the ``(N,)`` height of the ground (m).

    Only x and y count. Outside the town's terrain the height is 0. Where several surfaces lie above
    each other the highest counts.
    """
    mesh = town.static_mesh
    is_ground = np.isin(mesh.tag, _GROUND_TAGS) & (np.abs(mesh.normals[:, 0, 2]) > 0.5)
    corners = mesh.vertices[mesh.triangles[is_ground]].astype(np.float64)
    low, high = corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)
    origin, shape, start, count, entries = _cells(low, high)

    def height(places: NDArray[np.float64]) -> NDArray[np.float64]:
        points = np.asarray(places, dtype=np.float64)[:, :2]
        cell = np.floor(points / _CELL_M).astype(np.int64) - origin
        is_inside = ((cell >= 0) & (cell < shape)).all(axis=1)
        number = np.where(is_inside, cell[:, 0] * shape[1] + cell[:, 1], 0)
        found = np.where(is_inside, count[number], 0)
        column = np.arange(max(int(found.max(initial=0)), 1))
        slots = np.minimum(start[number][:, None] + column, len(entries) - 1)
        z = _highest(corners[entries[slots]], points, column < found[:, None])
        return np.where(np.isneginf(z), 0.0, z)

    return height


def _cells(
    low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[
    NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]
]:
    """A grid of cells that name the triangles whose boxes touch them.

    Returns:
        First cell (2,), number of cells (2,), and per cell the first and the number of its
        ``entries``, which are triangles.
    """
    first = np.floor(low / _CELL_M).astype(np.int64)
    last = np.floor(high / _CELL_M).astype(np.int64)
    origin = first.min(axis=0)
    shape = last.max(axis=0) - origin + 1
    spans = last - first + 1
    touched = spans.prod(axis=1)
    owner = np.repeat(np.arange(len(low)), touched)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(touched) - touched, touched)
    cell = first[owner] - origin
    cell[:, 0] += step // spans[owner, 1]
    cell[:, 1] += step % spans[owner, 1]
    number = cell[:, 0] * shape[1] + cell[:, 1]
    order = np.argsort(number, kind="stable")
    count = np.bincount(number, minlength=int(shape.prod()))
    return origin, shape, np.cumsum(count) - count, count, owner[order]


def _highest(
    corners: NDArray[np.float64], points: NDArray[np.float64], is_real: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Height of the highest of the triangles ``(N, K, 3, 3)`` that cover each point, or -inf."""
    a, b, c = corners[:, :, 0], corners[:, :, 1], corners[:, :, 2]
    ab, ac, ap = b - a, c - a, points[:, None] - a[..., :2]
    area = ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]
    v = (ap[..., 0] * ac[..., 1] - ap[..., 1] * ac[..., 0]) / area
    w = (ab[..., 0] * ap[..., 1] - ab[..., 1] * ap[..., 0]) / area
    covers = is_real & (v >= -_EDGE) & (w >= -_EDGE) & (v + w <= 1 + _EDGE)
    z = a[..., 2] + v * ab[..., 2] + w * ac[..., 2]
    heights: NDArray[np.float64] = np.where(covers, z, -np.inf).max(axis=1)
    return heights
