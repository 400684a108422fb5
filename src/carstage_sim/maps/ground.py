"""The ground: what wheels and feet stand on, with as many levels as bridges make of it.

A town's ground is every nearly horizontal triangle of its roads, sidewalks and terrain. A grid of
cells names the triangles that reach into each cell, so that a query looks at a handful of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.cell_index import CellIndex
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
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        corners = mesh.vertices[mesh.triangles[np.isin(mesh.tag, _GROUND_TAGS)]].astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normals, axis=1)
        corners = corners[np.abs(normals[:, 2]) > _LEAST_UPRIGHT * np.maximum(length, 1e-12)]
        self._planes = _planes(corners)
        self._cells = CellIndex(corners[..., :2], _FINEST_CELL_M)

    def highest(self, places: FloatArray) -> FloatArray:
        """Height of the highest surface at ``(M, 2)`` or ``(M, 3)`` places, NaN where none is."""
        points = np.asarray(places, dtype=np.float64)
        return self._look(points, np.full(len(points), np.inf))[0]

    def height_below(self, points: FloatArray, step_up_m: float = STEP_UP_M) -> FloatArray:
        """Height of the surface under each point: the highest that is not above it.

        Args:
            points: ``(M, 3)`` world metres.
            step_up_m: how much above a point a surface may be and still be under it.

        Returns:
            ``(M,)`` metres; NaN where there is none.
        """
        points = np.asarray(points, dtype=np.float64)
        return self._look(points, points[:, 2] + step_up_m)[0]

    def surface_below(
        self, points: FloatArray, step_up_m: float = STEP_UP_M
    ) -> tuple[FloatArray, FloatArray]:
        """Height and upward unit normal, ``(M,)`` and ``(M, 3)``, of the surface under points.

        As :meth:`height_below`; normals are NaN too where there is no surface.
        """
        points = np.asarray(points, dtype=np.float64)
        height, triangle = self._look(points, points[:, 2] + step_up_m)
        normal = np.full((len(points), 3), np.nan)
        found = ~np.isnan(height)
        normal[found, :2] = -self._planes[1:3, triangle[found]].T
        normal[found, 2] = 1.0
        return height, normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def _look(self, points: FloatArray, limit: FloatArray) -> tuple[FloatArray, IntArray]:
        """Highest surface of at most ``limit`` at each point, and its triangle (0 for none)."""
        count, entry = self._cells.at(points[:, :2])
        height = np.full(len(points), -np.inf)
        triangle = np.zeros(len(points), np.int64)
        if not len(entry):
            return np.full(len(points), np.nan), triangle
        owner = np.repeat(np.arange(len(points)), count)
        x, y = points[owner, 0], points[owner, 1]
        planes = self._planes.take(entry, axis=1)
        z = planes[0] + planes[1] * x + planes[2] * y
        u = planes[3] + planes[4] * x + planes[5] * y
        v = planes[6] + planes[7] * x + planes[8] * y
        covers = (u >= -_EDGE) & (v >= -_EDGE) & (u + v <= 1.0 + _EDGE) & (z <= limit[owner])
        z = np.where(covers, z, -np.inf)
        some = np.flatnonzero(count)
        height[some] = np.maximum.reduceat(z, (np.cumsum(count) - count)[some])
        wins = np.flatnonzero(covers & (z == height[owner]))[::-1]
        triangle[owner[wins]] = entry[wins]  # of equal ones the first, which is written last
        return np.where(np.isneginf(height), np.nan, height), triangle


def _planes(corners: FloatArray) -> FloatArray:
    """``(9, T)``: constant, x and y coefficients of a triangle's height and of two of its three
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
    return np.ascontiguousarray(planes.T)
