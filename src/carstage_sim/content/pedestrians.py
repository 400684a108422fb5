"""Pedestrians as boxes (first cut)."""

from __future__ import annotations

import numpy as np

from carstage_sim.content.vehicles import _box
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, merge_meshes

Vector = tuple[float, float, float]


def pedestrian_mesh(type_id: str, extent: Vector, phase: int = 0) -> TriangleMesh:
    """A pedestrian inside its box, origin at mid height."""
    hx, hy, hz = np.asarray(extent).tolist()
    tag = CityObjectLabel.PEDESTRIANS
    return merge_meshes(
        [
            _box((-hx * 0.6, -hy * 0.8, -hz), (hx * 0.6, hy * 0.8, 0.0), Material.CLOTH_LOWER, tag),
            _box((-hx * 0.7, -hy, 0.0), (hx * 0.7, hy, hz * 0.7), Material.CLOTH_UPPER, tag),
            _box((-hx * 0.5, -hy * 0.5, hz * 0.7), (hx * 0.5, hy * 0.5, hz), Material.SKIN, tag),
        ]
    )
