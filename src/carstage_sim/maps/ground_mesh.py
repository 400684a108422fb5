"""The ground as one surface: a planar partition, triangulated, with walls where heights differ.

Lines are faces of the partition, not decals above it, so a ray meets the ground exactly once and
nothing can flicker. All faces share their vertices, so the surface has no cracks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.drape import Drape, spread_heights
from carstage_sim.maps.partition import Partition, partition
from carstage_sim.maps.surfaces import Layer
from carstage_sim.mesh import Material, build_mesh, merge_meshes

_TILE_M = 50.0
_SAME_HEIGHT_M = 1e-6
BELOW_DECK_M = 1.3
"""Land and things stay this far below the lanes of a bridge: its deck's thickness and some air."""


class LevelSurface:
    """The surface of one level: a mesh, and its height at any place.

    Args:
        layers: overlapping areas, first one on top.
        drape: heights of the lanes.
        cuts: lines at which the lanes' profiles bend, and others along which to cut.
        ceilings: for land: areas of bridges with their lanes' heights, to stay below.

    Attributes:
        mesh: what is seen.
        outline: ``(E, 2, 3)`` edges that only one triangle has.
        paved_outline: the same of the surface without its land.
    """

    def __init__(
        self,
        layers: list[Layer],
        drape: Drape,
        cuts: Sequence[BaseGeometry] = (),
        ceilings: Sequence[tuple[BaseGeometry, Drape]] = (),
    ) -> None:
        plan = partition([layer.area for layer in layers], _TILE_M, cuts)
        xyz = _corner_heights(plan, layers, drape, ceilings)
        vertices, index = np.unique(xyz.reshape(-1, 3), axis=0, return_inverse=True)
        flat = build_mesh(
            vertices,
            index.reshape(-1, 3),
            np.array([layer.material for layer in layers])[plan.area],
            np.array([layer.tag for layer in layers])[plan.area],
            normals=None if drape.is_flat else _smooth_normals(xyz, plan),
        )
        walls = _walls(plan.triangles, xyz)
        self.mesh = flat
        if len(walls):
            steps = build_mesh(
                walls.reshape(-1, 3),
                np.arange(3 * len(walls)).reshape(-1, 3),
                Material.KERB,
                CityObjectLabel.SIDEWALKS,
            )
            self.mesh = merge_meshes([flat, steps])
        self.outline = _outline(plan.triangles, xyz)
        paved = ~np.array([layer.is_land for layer in layers])[plan.area]
        self.paved_outline = _outline(plan.triangles[paved], xyz[paved])
        self._xyz = xyz
        self._constant_m = float(xyz[0, 0, 2]) if np.ptp(xyz[..., 2]) < _SAME_HEIGHT_M else None
        self._tree: shapely.STRtree | None = None

    def height(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """``(P,)`` height (m) at ``(P, 2)`` places; the nearest edge's outside the surface."""
        found = self._triangle_at(points)
        a, b, c = (self._xyz[found, k] for k in range(3))
        ab, ac, ap = b - a, c - a, points - a[:, :2]
        area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
        v = (ap[:, 0] * ac[:, 1] - ap[:, 1] * ac[:, 0]) / area
        w = (ab[:, 0] * ap[:, 1] - ab[:, 1] * ap[:, 0]) / area
        v, w = np.clip(v, 0.0, 1.0), np.clip(w, 0.0, 1.0)
        z: NDArray[np.float64] = a[:, 2] + v * ab[:, 2] + w * ac[:, 2]
        return z

    def material(self, points: NDArray[np.float64]) -> NDArray[np.uint8]:
        """``(P,)`` material of the ground at ``(P, 2)`` places."""
        material: NDArray[np.uint8] = self.mesh.material[self._triangle_at(points)]
        return material

    def _triangle_at(self, points: NDArray[np.float64]) -> NDArray[np.intp]:
        if self._tree is None:
            rings = np.concatenate([self._xyz, self._xyz[:, :1]], axis=1)[..., :2]
            self._tree = shapely.STRtree(np.asarray(shapely.polygons(rings)))
        return np.asarray(self._tree.nearest(shapely.points(points)), np.intp)


def _corner_heights(
    plan: Partition,
    layers: list[Layer],
    drape: Drape,
    ceilings: Sequence[tuple[BaseGeometry, Drape]],
) -> NDArray[np.float64]:
    """``(T, 3, 3)`` corners of all triangles with their heights."""
    lanes_z = drape.height(plan.points)
    corners = plan.points[plan.triangles]
    heights = lanes_z[plan.triangles]
    is_land = np.array([layer.is_land for layer in layers])[plan.area]
    for number, layer in enumerate(layers):
        rows = np.flatnonzero(plan.area == number)
        if layer.ramp is None:
            heights[rows] += layer.height_m
        else:
            heights[rows] += layer.ramp.height(corners[rows].reshape(-1, 2)).reshape(-1, 3)
    if is_land.any() and drape.is_flat:
        # Level with the sidewalks; where there are none, with the road.
        heights[is_land] = heights[~is_land].max()
    elif is_land.any():
        known = np.full(len(plan.points), -np.inf)
        np.maximum.at(known, plan.triangles[~is_land], heights[~is_land])
        known[np.isneginf(known)] = np.nan
        free = np.isnan(known)
        land = spread_heights(plan.points, plan.triangles, known)
        for area, ceiling in ceilings:
            below = np.flatnonzero(free)
            x, y = plan.points[below].T
            below = below[shapely.contains_xy(area, x, y)]
            if len(below):
                top = ceiling.height(plan.points[below]) - BELOW_DECK_M
                land[below] = np.minimum(land[below], top)
        heights[is_land] = land[plan.triangles[is_land]]
    return np.concatenate([corners, heights[..., None]], axis=2).round(6)


def _smooth_normals(xyz: NDArray[np.float64], plan: Partition) -> NDArray[np.float64]:
    """``(T, 3, 3)`` normals per corner, shared by the triangles of one kind of ground."""
    flat = np.cross(xyz[:, 1] - xyz[:, 0], xyz[:, 2] - xyz[:, 0])
    key = plan.triangles.astype(np.int64) * (int(plan.area.max()) + 1) + plan.area[:, None]
    _, shared = np.unique(key.reshape(-1), return_inverse=True)
    total = np.zeros((int(shared.max()) + 1, 3))
    np.add.at(total, shared.reshape(-1), np.repeat(flat, 3, axis=0))
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
    normals: NDArray[np.float64] = total[shared.reshape(-1)].reshape(-1, 3, 3)
    return normals


def _outline(triangles: NDArray[np.int64], xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    begin, end = triangles.reshape(-1), np.roll(triangles, -1, axis=1).reshape(-1)
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    _, first, count = np.unique(
        np.stack([low, high], axis=1), axis=0, return_index=True, return_counts=True
    )
    rows = np.sort(first[count == 1])
    return np.stack([xyz.reshape(-1, 3)[rows], np.roll(xyz, -1, axis=1).reshape(-1, 3)[rows]], 1)


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
