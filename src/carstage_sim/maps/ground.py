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
_SEEN_M = 60.0
"""Triangles larger than this are terrain far out; they are tried for every point."""

GroundHeight = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def ground_height(town: Town) -> GroundHeight:
    """A function from ``(N, 2)`` x, y (m) to ``(N,)`` height of the ground (m).

    Outside the town's terrain the height is 0. Where several surfaces lie above each other the
    highest counts.
    """
    mesh = town.static_mesh
    is_ground = np.isin(mesh.tag, _GROUND_TAGS) & (np.abs(mesh.normals[:, 0, 2]) > 0.5)
    corners = mesh.vertices[mesh.triangles[is_ground]].astype(np.float64)
    low, high = corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)
    is_large = (high - low).max(axis=1) > _SEEN_M
    large = np.flatnonzero(is_large)
    cells: dict[tuple[int, int], list[int]] = {}
    for i in np.flatnonzero(~is_large):
        (i0, j0), (i1, j1) = np.floor(low[i] / _CELL_M), np.floor(high[i] / _CELL_M)
        for cell_x in range(int(i0), int(i1) + 1):
            for cell_y in range(int(j0), int(j1) + 1):
                cells.setdefault((cell_x, cell_y), []).append(int(i))
    near = {cell: np.array(entries) for cell, entries in cells.items()}

    def height(points: NDArray[np.float64]) -> NDArray[np.float64]:
        result = np.zeros(len(points))
        for n, (x, y) in enumerate(points):
            found = near.get((int(x // _CELL_M), int(y // _CELL_M)))
            z = _height_in(corners[found], x, y) if found is not None else None
            if z is None:
                z = _height_in(corners[large], x, y)
            result[n] = 0.0 if z is None else z
        return result

    return height


def _height_in(corners: NDArray[np.float64], x: float, y: float) -> float | None:
    """Height of the highest of the triangles ``(T, 3, 3)`` that cover a point."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    v = ((x - a[:, 0]) * (c[:, 1] - a[:, 1]) - (y - a[:, 1]) * (c[:, 0] - a[:, 0])) / area
    w = ((b[:, 0] - a[:, 0]) * (y - a[:, 1]) - (b[:, 1] - a[:, 1]) * (x - a[:, 0])) / area
    inside = (v >= -1e-9) & (w >= -1e-9) & (v + w <= 1 + 1e-9)
    if not inside.any():
        return None
    z = a[:, 2] + v * (b[:, 2] - a[:, 2]) + w * (c[:, 2] - a[:, 2])
    return float(z[inside].max())
