"""The ground: what wheels and feet stand on, with as many levels as bridges make of it.

A town's ground is every nearly horizontal triangle of its roads, sidewalks and terrain. A grid of
cells names the triangles that reach into each cell, so that a query looks at a handful of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import kernel
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.cell_index import cell_grid
from carstage_sim.maps.town import Town
from carstage_sim.mesh import TriangleMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

STEP_UP_M = 0.6
"""A surface that is at most this much above a wheel or a foot carries it; a higher one is above."""

_GROUND_TAGS = (
    CityObjectLabel.ROADS,
    CityObjectLabel.ROAD_LINES,
    CityObjectLabel.SIDEWALKS,
    CityObjectLabel.TERRAIN,
    CityObjectLabel.GROUND,
    CityObjectLabel.BRIDGE,
    CityObjectLabel.RAIL_TRACK,
)
_LEAST_UPRIGHT = 0.5  # of the normal's z: steeper triangles are kerbs and walls
_FINEST_CELL_M = 2.0
_EDGE = 1e-6  # of a triangle's size: points on a seam belong to both sides

GroundHeight = Callable[[FloatArray], FloatArray]


def ground_height(town: Town) -> GroundHeight:
    """A function from ``(N, 2)`` or ``(N, 3)`` places (m) to the ``(N,)`` height of the ground (m).

    Only x and y count: of several levels the highest one. Outside the town's terrain it is 0.
    """
    ground = Ground(town.static_mesh)
    return lambda places: np.nan_to_num(ground.highest(places))


class Ground:
    """Heights and normals of the surfaces that one can stand on.

    Args:
        mesh: the scenery; what has a label of ground and is not steep counts.

    Attributes:
        top_m: no surface is higher; minus infinity where there is none.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        corners = mesh.vertices[mesh.triangles[np.isin(mesh.tag, _GROUND_TAGS)]].astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normals, axis=1)
        corners = corners[np.abs(normals[:, 2]) > _LEAST_UPRIGHT * np.maximum(length, 1e-12)]
        self.top_m = float(corners[..., 2].max(initial=-np.inf))
        self._planes = _planes(corners)
        self._grid = cell_grid(corners[..., :2], _FINEST_CELL_M)

    def highest(self, places: FloatArray) -> FloatArray:
        """Height of the highest surface at ``(M, 2)`` or ``(M, 3)`` places, NaN where none is."""
        points = np.ascontiguousarray(places, np.float64)
        return self._look(points, np.full(len(points), np.inf))[0]

    def height_below(self, points: FloatArray, step_up_m: float = STEP_UP_M) -> FloatArray:
        """Height of the surface under each point: the highest that is not above it.

        Args:
            points: ``(M, 3)`` world metres.
            step_up_m: how much above a point a surface may be and still be under it.

        Returns:
            ``(M,)`` metres; NaN where there is none.
        """
        points = np.ascontiguousarray(points, np.float64)
        return self._look(points, points[:, 2] + step_up_m)[0]

    def surface_below(
        self, points: FloatArray, step_up_m: float = STEP_UP_M
    ) -> tuple[FloatArray, FloatArray]:
        """Height and upward unit normal, ``(M,)`` and ``(M, 3)``, of the surface under points.

        As :meth:`height_below`; normals are NaN too where there is no surface.
        """
        points = np.ascontiguousarray(points, np.float64)
        height, triangle = self._look(points, points[:, 2] + step_up_m)
        normal = np.full((len(points), 3), np.nan)
        found = ~np.isnan(height)
        normal[found, :2] = -self._planes[triangle[found], 1:3]
        normal[found, 2] = 1.0
        return height, normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def _look(self, points: FloatArray, limit: FloatArray) -> tuple[FloatArray, IntArray]:
        """Highest surface of at most ``limit`` at each point, and its triangle (0 for none)."""
        height = np.full(len(points), np.nan)
        triangle = np.zeros(len(points), np.int64)
        _highest(points, limit, self._planes, self._grid, height, triangle)
        return height, triangle


@kernel
def _highest(  # type: ignore[no-untyped-def]
    points, limit, planes, grid, height, triangle
):
    """Writes height and triangle of the highest surface at each point that has one.

    Args:
        limit: ``(M,)`` highest that counts, metres.
        planes: ``(T, 9)`` of the triangles.
        grid: the cells of the triangles.
    """
    for point in range(points.shape[0]):
        x, y = points[point, 0], points[point, 1]
        cell_x = np.floor((x - grid.low[0]) / grid.cell_m)
        cell_y = np.floor((y - grid.low[1]) / grid.cell_m)
        if not (0.0 <= cell_x < grid.shape[0] and 0.0 <= cell_y < grid.shape[1]):
            continue
        cell = int(cell_x) * grid.shape[1] + int(cell_y)
        best = -np.inf
        for entry in range(grid.start[cell], grid.start[cell + 1]):
            row = grid.entries[entry]
            u = planes[row, 3] + planes[row, 4] * x + planes[row, 5] * y
            v = planes[row, 6] + planes[row, 7] * x + planes[row, 8] * y
            if not (u >= -_EDGE and v >= -_EDGE and u + v <= 1.0 + _EDGE):
                continue
            z = planes[row, 0] + planes[row, 1] * x + planes[row, 2] * y
            if best < z <= limit[point]:  # of equal ones the first
                best = z
                height[point], triangle[point] = z, row


def _planes(corners: FloatArray) -> FloatArray:
    """``(T, 9)``: constant, x and y coefficients of a triangle's height and of two of its three
    barycentric coordinates, so that each is one multiplication and addition per axis away."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac = b - a, c - a
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    planes = np.empty((len(corners), 9))
    planes[:, 4], planes[:, 5] = ac[:, 1] / area, -ac[:, 0] / area
    planes[:, 7], planes[:, 8] = -ab[:, 1] / area, ab[:, 0] / area
    for first in (3, 6):
        planes[:, first] = -(planes[:, first + 1] * a[:, 0] + planes[:, first + 2] * a[:, 1])
    planes[:, :3] = planes[:, 3:6] * ab[:, 2:] + planes[:, 6:9] * ac[:, 2:]
    planes[:, 0] += a[:, 2]
    return planes
