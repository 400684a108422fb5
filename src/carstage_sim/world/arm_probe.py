"""Keeps a spring arm's end out of the scenery."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.mesh import TriangleMesh
from carstage_sim.world.pose import Vector3

_PARALLEL = 1e-12


class ArmProbe:
    """Finds the nearest triangle of a mesh on short ways.

    An arm is some metres long and moves once per tick, so a look at the triangles whose boxes it
    crosses is enough, and no acceleration structure is needed. UE sweeps a ball; this is its
    middle.

    Args:
        mesh: the town's scenery.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self._mesh = mesh
        corners = mesh.vertices[mesh.triangles]
        self._low: NDArray[np.float32] = corners.min(axis=1)
        self._high: NDArray[np.float32] = corners.max(axis=1)

    def __call__(self, start: Vector3, end: Vector3) -> float | None:
        """Metres from the start to the first triangle; None where the way is free."""
        origin = np.asarray(start, np.float64)
        direction = np.asarray(end, np.float64) - origin
        low = np.minimum(start, end).astype(np.float32)
        high = np.maximum(start, end).astype(np.float32)
        near = (self._low <= high).all(axis=1) & (self._high >= low).all(axis=1)
        corners = self._mesh.vertices[self._mesh.triangles[near]].astype(np.float64)
        # Möller and Trumbore's test of a ray with triangles.
        edge_1, edge_2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        across = np.cross(direction, edge_2)
        determinant = np.einsum("ij,ij->i", edge_1, across)
        usable = np.abs(determinant) > _PARALLEL
        inverse = 1.0 / np.where(usable, determinant, 1.0)
        to_origin = origin - corners[:, 0]
        u = np.einsum("ij,ij->i", to_origin, across) * inverse
        turned = np.cross(to_origin, edge_1)
        v = turned @ direction * inverse
        share = np.einsum("ij,ij->i", edge_2, turned) * inverse
        hit = usable & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (share >= 0.0) & (share <= 1.0)
        if not hit.any():
            return None
        return float(share[hit].min() * np.linalg.norm(direction))
