"""Where a segment meets the scenery: the few single rays that clients ask for."""

from __future__ import annotations

import numpy as np

from carstage_sim.mesh import TriangleMesh
from carstage_sim.world.pose import Vector3

_PARALLEL = 1e-12


def segment_hits(mesh: TriangleMesh, start: Vector3, end: Vector3) -> list[tuple[Vector3, int]]:
    """Hits of a segment with every triangle of a mesh, nearest first.

    Möller and Trumbore's test on all triangles at once: some milliseconds, which is little beside
    a call over the wire and needs no acceleration structure.

    Args:
        mesh: the scenery.
        start, end: world metres.

    Returns:
        location and semantic label of each hit; hits at one place count once.
    """
    origin = np.asarray(start, np.float64)
    direction = np.asarray(end, np.float64) - origin
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
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
    found: dict[tuple[float, float, float], int] = {}
    for triangle in np.flatnonzero(hit)[np.argsort(share[hit], kind="stable")]:
        x, y, z = np.round(origin + share[triangle] * direction, 6).tolist()
        found.setdefault((x, y, z), int(mesh.tag[triangle]))
    return list(found.items())
