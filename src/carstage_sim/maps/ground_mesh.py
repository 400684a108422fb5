"""The ground as one surface: a planar partition, triangulated, with walls where heights differ.

Lines are faces of the partition, not decals above it, so a ray meets the ground exactly once and
nothing can flicker. All faces share their vertices, so the surface has no cracks.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.surfaces import Layer
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes

_GRID_M = 0.001
_TILE_M = 40.0
"""Faces are cut along a grid of this width: small ones triangulate faster and trace better."""


def ground_mesh(layers: list[Layer]) -> TriangleMesh:
    """The mesh of overlapping layers, first one on top; the last one covers everything."""
    faces = _faces(layers)
    owner = _owners(faces, layers)
    return _walled(*_triangles(faces[owner >= 0], owner[owner >= 0], layers), layers)


def _faces(layers: list[Layer]) -> NDArray[np.object_]:
    """The faces of the plane that the layers' outlines and a coarse grid cut out."""
    x0, y0, x1, y1 = layers[-1].area.bounds
    lines = [shapely.boundary(layer.area) for layer in layers if not layer.area.is_empty]
    inner = shapely.union_all([layer.area for layer in layers[:-1]]).bounds
    lines += [
        shapely.LineString([(x, y0), (x, y1)])
        for x in np.arange(np.ceil(inner[0] / _TILE_M), inner[2] / _TILE_M) * _TILE_M
    ]
    lines += [
        shapely.LineString([(x0, y), (x1, y)])
        for y in np.arange(np.ceil(inner[1] / _TILE_M), inner[3] / _TILE_M) * _TILE_M
    ]
    noded = shapely.union_all(lines, grid_size=_GRID_M)
    return np.asarray(shapely.get_parts(shapely.polygonize(shapely.get_parts(noded))))


def _owners(faces: NDArray[np.object_], layers: list[Layer]) -> NDArray[np.int64]:
    """Index of the first layer that holds each face, -1 outside all of them."""
    inside = shapely.point_on_surface(faces)
    x, y = shapely.get_x(inside), shapely.get_y(inside)
    owner: NDArray[np.int64] = np.full(len(faces), -1, dtype=np.int64)
    for index, layer in enumerate(layers):
        shapely.prepare(layer.area)
        free = np.flatnonzero(owner < 0)
        owner[free[shapely.contains_xy(layer.area, x[free], y[free])]] = index
    return owner


def _triangles(
    faces: NDArray[np.object_], owner: NDArray[np.int64], layers: list[Layer]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Corner ids in the plane ``(T, 3)``, heights ``(T, 3)`` and layers ``(T,)``."""
    parts, face = shapely.get_parts(
        shapely.constrained_delaunay_triangles(faces), return_index=True
    )
    corners = shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    corners[turn < 0] = corners[turn < 0, ::-1]
    keep = np.abs(turn) > 1e-9
    corners, layer = corners[keep], owner[face[keep]]
    heights = np.zeros(corners.shape[:2])
    for index, entry in enumerate(layers):
        rows = layer == index
        if entry.ramp is None:
            heights[rows] = entry.height_m
        else:
            heights[rows] = entry.ramp.height(corners[rows].reshape(-1, 2)).reshape(-1, 3)
    keys = np.rint(corners / _GRID_M).astype(np.int64)
    return keys, heights, layer


def _walled(
    keys: NDArray[np.int64],
    heights: NDArray[np.float64],
    layer: NDArray[np.int64],
    layers: list[Layer],
) -> TriangleMesh:
    """The flat triangles and the vertical ones between neighbours of different height."""
    xyz = np.concatenate([keys * _GRID_M, heights[..., None]], axis=2)
    vertices, index = np.unique(xyz.reshape(-1, 3).round(6), axis=0, return_inverse=True)
    material = np.array([entry.material for entry in layers])[layer]
    tag = np.array([entry.tag for entry in layers])[layer]
    flat = build_mesh(vertices, index.reshape(-1, 3), material, tag)

    _, point = np.unique(keys.reshape(-1, 2), axis=0, return_inverse=True)
    point = point.reshape(-1, 3)
    seen: dict[tuple[int, int], tuple[int, int]] = {}
    walls: list[NDArray[np.float64]] = []
    for triangle in range(len(point)):
        for k in range(3):
            n = (k + 1) % 3
            other = seen.pop((int(point[triangle, n]), int(point[triangle, k])), None)
            if other is None:
                seen[int(point[triangle, k]), int(point[triangle, n])] = (triangle, k)
                continue
            t, m = other
            # The neighbour runs along the shared edge the other way.
            a, b = xyz[triangle, k], xyz[triangle, n]
            a2, b2 = xyz[t, (m + 1) % 3], xyz[t, m]
            if abs(a[2] - a2[2]) > 1e-6:
                walls.append(np.stack([a, b, a2]))
            if abs(b[2] - b2[2]) > 1e-6:
                walls.append(np.stack([b, b2, a2]))
    if not walls:
        return flat
    corners = np.concatenate(walls)
    kerbs = build_mesh(
        corners,
        np.arange(len(corners)).reshape(-1, 3),
        Material.KERB,
        CityObjectLabel.SIDEWALKS,
    )
    return merge_meshes([flat, kerbs])
