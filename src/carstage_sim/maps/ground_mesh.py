"""The ground as one surface: a planar partition, triangulated, with walls where heights differ.

Lines are faces of the partition, not decals above it, so a ray meets the ground exactly once and
nothing can flicker. All faces share their vertices, so the surface has no cracks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.partition import partition
from carstage_sim.maps.surfaces import Layer
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes

_TILE_M = 50.0
_SAME_HEIGHT_M = 1e-6


def ground_mesh(layers: list[Layer]) -> TriangleMesh:
    """The mesh of overlapping layers, first one on top."""
    plan = partition([layer.area for layer in layers], _TILE_M)
    corners = plan.points[plan.triangles]
    heights = np.zeros(corners.shape[:2])
    for number, layer in enumerate(layers):
        rows = plan.area == number
        if layer.ramp is None:
            heights[rows] = layer.height_m
        else:
            heights[rows] = layer.ramp.height(corners[rows].reshape(-1, 2)).reshape(-1, 3)
    xyz = np.concatenate([corners, heights[..., None]], axis=2).round(6)
    vertices, index = np.unique(xyz.reshape(-1, 3), axis=0, return_inverse=True)
    flat = build_mesh(
        vertices,
        index.reshape(-1, 3),
        np.array([layer.material for layer in layers])[plan.area],
        np.array([layer.tag for layer in layers])[plan.area],
    )
    walls = _walls(plan.triangles, xyz)
    if not len(walls):
        return flat
    steps = build_mesh(
        walls.reshape(-1, 3),
        np.arange(3 * len(walls)).reshape(-1, 3),
        Material.KERB,
        CityObjectLabel.SIDEWALKS,
    )
    return merge_meshes([flat, steps])


def _walls(triangles: NDArray[np.int64], xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vertical triangles ``(N, 3, 3)`` along edges whose two sides differ in height.

    Args:
        triangles: ``(T, 3)`` places in the plane.
        xyz: ``(T, 3, 3)`` their corners with height.
    """
    count = len(triangles)
    begin, end = triangles.reshape(-1), np.roll(triangles, -1, axis=1).reshape(-1)
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    order = np.lexsort((begin > end, high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    one, two = order[:-1][same], order[1:][same]

    a, b = xyz.reshape(-1, 3), np.roll(xyz, -1, axis=1).reshape(3 * count, 3)
    # The neighbour runs along the shared edge the other way: its end is our beginning.
    near_begin = np.abs(a[one, 2] - b[two, 2]) > _SAME_HEIGHT_M
    near_end = np.abs(b[one, 2] - a[two, 2]) > _SAME_HEIGHT_M
    first = np.stack([a[one], b[one], b[two]], axis=1)[near_begin]
    second = np.stack([b[one], a[two], b[two]], axis=1)[near_end]
    return np.concatenate([first, second])
