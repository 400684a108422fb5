"""Vehicles as boxes (first cut)."""

from __future__ import annotations

import numpy as np

from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes

Vector = tuple[float, float, float]


def _box(low: Vector, high: Vector, material: Material, tag: int) -> TriangleMesh:
    corners = np.array(
        [[(low, high)[(k >> a) & 1][a] for a in range(3)] for k in range(8)], np.float64
    )
    quads = np.array(
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    )
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return build_mesh(corners, triangles, material, tag)


def vehicle_mesh(type_id: str, extent: Vector, box_center: Vector) -> TriangleMesh:
    """A vehicle inside its box."""
    hx, hy, hz = extent
    cx, cy, cz = box_center
    bottom = max(cz - hz, 0.0)
    top = cz + hz
    waist = bottom + 0.55 * (top - bottom)
    tag = CityObjectLabel.CAR
    return merge_meshes(
        [
            _box((cx - hx, cy - hy, bottom), (cx + hx, cy + hy, waist), Material.PAINT, tag),
            _box(
                (cx - 0.8 * hx, cy - 0.85 * hy, waist),
                (cx + 0.4 * hx, cy + 0.85 * hy, top),
                Material.GLASS,
                tag,
            ),
        ]
    )
