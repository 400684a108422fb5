"""What makes a raised road a bridge: the deck's body, parapets along its open edges."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.ground_mesh import LevelSurface
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes

DECK_THICKNESS_M = 0.9
_PARAPET_HEIGHT_M = 0.85
_PARAPET_WIDTH_M = 0.25
_SEAM_M = 0.25
_SAME_HEIGHT_M = 0.4


def bridge_mesh(
    surface: LevelSurface, neighbours: list[tuple[BaseGeometry, LevelSurface]]
) -> TriangleMesh:
    """Underside, sides and parapets of a level above the ground.

    Args:
        surface: the level's.
        neighbours: road areas and surfaces of the levels that it may run on into.
    """
    flat = surface.mesh
    below = flat.vertices.astype(np.float64) - np.array([0.0, 0.0, DECK_THICKNESS_M])
    label = CityObjectLabel
    parts = [build_mesh(below, flat.triangles[:, ::-1], Material.CONCRETE, label.BRIDGE)]
    edges = surface.outline
    if len(edges):
        drop = np.array([0.0, 0.0, DECK_THICKNESS_M])
        sides = np.stack([edges[:, 0], edges[:, 0] - drop, edges[:, 1] - drop, edges[:, 1]], 1)
        parts.append(_quads(sides, label.BRIDGE))
        open_edges = edges[~_is_seam(edges, neighbours)]
        if len(open_edges):
            parts.append(_parapets(open_edges))
    return merge_meshes(parts)


def wall_mesh(surface: LevelSurface, height_m: float) -> TriangleMesh:
    """Upright walls along all edges of the paved ground of a level."""
    edges = surface.paved_outline
    up = np.array([0.0, 0.0, height_m])
    quads = np.stack([edges[:, 0], edges[:, 1], edges[:, 1] + up, edges[:, 0] + up], axis=1)
    return _quads(quads, CityObjectLabel.WALLS)


def _is_seam(
    edges: NDArray[np.float64], neighbours: list[tuple[BaseGeometry, LevelSurface]]
) -> NDArray[np.bool_]:
    """Which edges a road of another level goes on from, at the same height."""
    middle = edges.mean(axis=1)
    result: NDArray[np.bool_] = np.zeros(len(edges), dtype=np.bool_)
    points = shapely.points(middle[:, :2])
    for road, other in neighbours:
        shapely.prepare(road)
        near = np.flatnonzero(shapely.dwithin(road, points, _SEAM_M))
        if len(near):
            gap = np.abs(other.height(middle[near, :2]) - middle[near, 2])
            result[near[gap < _SAME_HEIGHT_M]] = True
    return result


def _parapets(edges: NDArray[np.float64]) -> TriangleMesh:
    """A wall on the outside of every edge; the surface lies to the left of each in x, y."""
    along = edges[:, 1] - edges[:, 0]
    along /= np.maximum(np.linalg.norm(along[:, :2], axis=1, keepdims=True), 1e-9)
    out = np.stack([along[:, 1], -along[:, 0], np.zeros(len(along))], axis=1) * _PARAPET_WIDTH_M
    up = np.array([0.0, 0.0, _PARAPET_HEIGHT_M])
    down = np.array([0.0, 0.0, DECK_THICKNESS_M])
    a, b = edges[:, 0], edges[:, 1]
    inner = np.stack([a, b, b + up, a + up], axis=1)
    top = np.stack([a + up, b + up, b + up + out, a + up + out], axis=1)
    outer = np.stack([a + up + out, b + up + out, b + out - down, a + out - down], axis=1)
    ends = [np.stack([p, p + up, p + up + out, p + out - down], axis=1) for p in (a, b)]
    return _quads(np.concatenate([inner, top, outer, *ends]), CityObjectLabel.GUARD_RAIL)


def _quads(corners: NDArray[np.float64], tag: CityObjectLabel) -> TriangleMesh:
    """``(N, 4, 3)`` quadrilaterals as a mesh; slivers are left out."""
    triangles = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    size = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    triangles = triangles[np.linalg.norm(size, axis=1) > 1e-6]
    index = np.arange(3 * len(triangles)).reshape(-1, 3)
    return build_mesh(triangles.reshape(-1, 3), index, Material.CONCRETE, tag)
