"""How high the ground is under a point: what walkers stand on."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import TriangleMesh

_CELL_M = 4.0
_OUTSIDE_TOLERANCE = 1e-9
_FLAT_M2 = 1e-9
_WALKED_ON = (
    CityObjectLabel.ROADS,
    CityObjectLabel.ROAD_LINES,
    CityObjectLabel.SIDEWALKS,
    CityObjectLabel.GROUND,
    CityObjectLabel.TERRAIN,
)


class Ground:
    """Heights of the surfaces that one can stand on, by a grid of their triangles.

    Args:
        mesh: the scenery; what has a label of ground and is not vertical counts.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        triangles = mesh.triangles[np.isin(mesh.tag, _WALKED_ON)]
        corners = mesh.vertices[triangles].astype(np.float64)
        edge_1, edge_2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = edge_1[:, 0] * edge_2[:, 1] - edge_1[:, 1] * edge_2[:, 0]
        kept = np.abs(area) > _FLAT_M2
        self._origin = corners[kept, 0]
        self._edge_1, self._edge_2, self._area = edge_1[kept], edge_2[kept], area[kept]
        self._cells = _triangles_by_cell(corners[kept, :, :2])

    def height(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of the highest surface at the places of ``(M, 2 or 3)`` points.

        Returns:
            ``(M,)`` metres; NaN where there is none.
        """
        return np.array([self._height_at(point) for point in points], np.float64)

    def _height_at(self, point: NDArray[np.float64]) -> float:
        cell = (int(point[0] // _CELL_M), int(point[1] // _CELL_M))
        triangles = self._cells.get(cell)
        if triangles is None:
            return math.nan
        to_point = point[:2] - self._origin[triangles, :2]
        edge_1, edge_2 = self._edge_1[triangles], self._edge_2[triangles]
        area = self._area[triangles]
        u = (to_point[:, 0] * edge_2[:, 1] - to_point[:, 1] * edge_2[:, 0]) / area
        v = (edge_1[:, 0] * to_point[:, 1] - edge_1[:, 1] * to_point[:, 0]) / area
        inside = (
            (u >= -_OUTSIDE_TOLERANCE)
            & (v >= -_OUTSIDE_TOLERANCE)
            & (u + v <= 1.0 + _OUTSIDE_TOLERANCE)
        )
        if not inside.any():
            return math.nan
        z = self._origin[triangles, 2] + u * edge_1[:, 2] + v * edge_2[:, 2]
        return float(z[inside].max())


def _triangles_by_cell(
    corners: NDArray[np.float64],
) -> dict[tuple[int, int], NDArray[np.intp]]:
    """Indices of the triangles whose bounding rectangles touch each cell."""
    low = np.floor(corners.min(axis=1) / _CELL_M).astype(np.intp)
    high = np.floor(corners.max(axis=1) / _CELL_M).astype(np.intp)
    cells: dict[tuple[int, int], list[int]] = {}
    for index, ((x0, y0), (x1, y1)) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        for x in range(x0, x1 + 1):
            for y in range(y0, y1 + 1):
                cells.setdefault((x, y), []).append(index)
    return {cell: np.array(members, np.intp) for cell, members in cells.items()}
