"""Planar partitions: overlapping areas in, triangles that share all their vertices out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage_sim.maps.delaunay import delaunay

GRID_M = 0.001
"""All vertices lie on a grid of this width, so that equal places have equal coordinates."""


@dataclass(frozen=True, slots=True)
class Partition:
    """Triangles of a partition of the plane.

    Attributes:
        points: ``(P, 2)`` m, each place once.
        triangles: ``(T, 3)`` indices into ``points``, counter-clockwise in x, y.
        area: ``(T,)`` index of the area that each triangle belongs to.
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int64]
    area: NDArray[np.int64]


def partition(
    areas: Sequence[BaseGeometry], tile_m: float, cuts: Sequence[BaseGeometry] = ()
) -> Partition:
    """Cuts the union of ``areas`` so that each place belongs to the first area that holds it.

    Neighbouring triangles share whole edges: there are no T-junctions.

    Args:
        areas: polygons, multi-polygons or empty geometries.
        tile_m: everything is cut along a grid of this width too; small faces triangulate faster.
        cuts: lines along which faces are cut as well.
    """
    faces = _faces(areas, tile_m, cuts)
    owner = _owners(faces, areas)
    faces, owner = faces[owner >= 0], owner[owner >= 0]
    parts, face = shapely.get_parts(
        shapely.constrained_delaunay_triangles(faces), return_index=True
    )
    corners = shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3]
    keys = np.rint(corners / GRID_M).astype(np.int64)
    points, index = np.unique(keys.reshape(-1, 2), axis=0, return_inverse=True)
    drawn = _counter_clockwise(points, index.reshape(-1, 3))
    triangles, face = delaunay(points, drawn, face.astype(np.int64))
    return Partition((points * GRID_M).astype(np.float64), triangles, owner[face])


def _counter_clockwise(
    points: NDArray[np.int64], triangles: NDArray[np.int64]
) -> NDArray[np.int64]:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return np.where((turn < 0)[:, None], triangles[:, ::-1], triangles)


def _faces(
    areas: Sequence[BaseGeometry], tile_m: float, cuts: Sequence[BaseGeometry]
) -> NDArray[np.object_]:
    lines = [shapely.boundary(area) for area in areas if not area.is_empty]
    x0, y0, x1, y1 = shapely.union_all(lines).bounds
    lines += [
        shapely.LineString([(x, y0), (x, y1)])
        for x in np.arange(np.floor(x0 / tile_m) + 1, x1 / tile_m) * tile_m
    ]
    lines += [
        shapely.LineString([(x0, y), (x1, y)])
        for y in np.arange(np.floor(y0 / tile_m) + 1, y1 / tile_m) * tile_m
    ]
    noded = shapely.union_all([*lines, *cuts], grid_size=GRID_M)
    return np.asarray(shapely.get_parts(shapely.polygonize(shapely.get_parts(noded))))


def _owners(faces: NDArray[np.object_], areas: Sequence[BaseGeometry]) -> NDArray[np.int64]:
    """Index of the first area that holds each face, -1 outside all of them."""
    inside = shapely.point_on_surface(faces)
    x, y = shapely.get_x(inside), shapely.get_y(inside)
    owner: NDArray[np.int64] = np.full(len(faces), -1, dtype=np.int64)
    for index, area in enumerate(areas):
        shapely.prepare(area)
        free = np.flatnonzero(owner < 0)
        owner[free[shapely.contains_xy(area, x[free], y[free])]] = index
    return owner
