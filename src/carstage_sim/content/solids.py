"""Building blocks of static scenery: boxes, tubes, plates, each as a triangle mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh

_BOX_CORNERS = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
_BOX_QUADS = np.array(
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
)


def quads_to_triangles(quads: ArrayLike) -> NDArray[np.int32]:
    """``(2 N, 3)`` triangles of ``(N, 4)`` quads."""
    q = np.asarray(quads, dtype=np.int32).reshape(-1, 4)
    return np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]], axis=1).reshape(-1, 3)


def quad_mesh(
    corners: ArrayLike, material: Material | NDArray[np.integer], tag: CityObjectLabel
) -> TriangleMesh:
    """Separate quads from ``(N, 4, 3)`` corners; ``material`` is one value or one per quad.

    A quad with two equal corners is a triangle.
    """
    points = np.asarray(corners, dtype=np.float64).reshape(-1, 3)
    index = quads_to_triangles(np.arange(len(points)).reshape(-1, 4))
    a, b, c = (points[index[:, k]] for k in range(3))
    has_area = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-9
    per_quad = np.broadcast_to(np.asarray(material), (len(points) // 4,))
    return build_mesh(points, index[has_area], np.repeat(per_quad, 2)[has_area], tag)


def box(
    center: ArrayLike,
    half_size: ArrayLike,
    material: Material,
    tag: CityObjectLabel,
    *,
    yaw_deg: float = 0.0,
) -> TriangleMesh:
    """A box turned about its vertical axis."""
    points = _BOX_CORNERS * np.asarray(half_size, dtype=np.float64)
    c, s = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    points = points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    points = points + np.asarray(center, dtype=np.float64)
    return quad_mesh(points[_BOX_QUADS], material, tag)


def tube(
    path: ArrayLike,
    radii_m: ArrayLike,
    material: Material,
    tag: CityObjectLabel,
    *,
    sides: int = 8,
    capped: bool = True,
) -> TriangleMesh:
    """A round tube with smooth normals along ``path`` ``(N, 3)``, ``radii_m`` one or one per point.

    Consecutive path points must not be vertical neighbours of a sharp bend: rings are not mitred.
    """
    points = np.asarray(path, dtype=np.float64)
    radii = np.broadcast_to(np.asarray(radii_m, dtype=np.float64), (len(points),))
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # A fixed helper direction keeps the rings from twisting; any one not along the path does.
    helper = np.eye(3)[int(np.argmin(np.abs(tangent).max(axis=0)))]
    side = np.cross(tangent, helper)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, tangent)
    angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    out = np.cos(angle)[None, :, None] * side[:, None] + np.sin(angle)[None, :, None] * up[:, None]
    vertices = (points[:, None] + out * radii[:, None, None]).reshape(-1, 3)
    normals = out.reshape(-1, 3)
    ring = np.arange(sides)
    quads = np.concatenate(
        [
            np.stack([ring, (ring + 1) % sides, (ring + 1) % sides + sides, ring + sides], axis=1)
            + i * sides
            for i in range(len(points) - 1)
        ]
    )
    triangles = quads_to_triangles(quads)
    corner_normals = normals[triangles]
    if capped:
        fans, fan_normals = [], []
        for first, direction in ((0, -tangent[0]), ((len(points) - 1) * sides, tangent[-1])):
            fan = np.stack(
                [np.full(sides - 2, first), first + ring[1:-1], first + ring[2:]], axis=1
            )
            fans.append(fan)
            fan_normals.append(np.broadcast_to(direction, (*fan.shape, 3)))
        triangles = np.concatenate([triangles, *fans])
        corner_normals = np.concatenate([corner_normals, *fan_normals])
    return build_mesh(vertices, triangles, material, tag, normals=corner_normals)


def disc(
    center: ArrayLike,
    normal: ArrayLike,
    radius_m: float,
    material: Material,
    tag: CityObjectLabel,
    *,
    sides: int = 12,
) -> TriangleMesh:
    """A flat round plate that faces ``normal``, which is horizontal."""
    face = np.asarray(normal, dtype=np.float64)
    side = np.cross(face, (0.0, 0.0, 1.0))
    angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    rim = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * np.array([0.0, 0.0, 1.0])
    points = np.asarray(center, dtype=np.float64) + radius_m * rim
    ring = np.arange(1, sides - 1)
    fan = np.stack([np.zeros_like(ring), ring, ring + 1], axis=1)
    normals = np.broadcast_to(face, (*fan.shape, 3))
    return build_mesh(points, fan, material, tag, normals=normals)


def placed(
    mesh: TriangleMesh,
    location: Sequence[float],
    *,
    yaw_deg: float = 0.0,
    lean_deg: tuple[float, float] = (0.0, 0.0),
    object_id: int | None = None,
) -> TriangleMesh:
    """A copy turned by ``yaw_deg``, moved to ``location`` (m), with another object id if given.

    ``lean_deg`` is its pitch and roll, as CARLA counts them.
    """
    c, s = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    if lean_deg != (0.0, 0.0):
        pitch_deg, roll_deg = lean_deg
        turn = rotation_matrix(np.array([pitch_deg, yaw_deg, roll_deg])).reshape(3, 3).T
    ids = mesh.object_id if object_id is None else np.full_like(mesh.object_id, object_id)
    return TriangleMesh(
        vertices=(mesh.vertices @ turn + np.asarray(location)).astype(np.float32),
        triangles=mesh.triangles,
        normals=(mesh.normals @ turn).astype(np.float32),
        material=mesh.material,
        tag=mesh.tag,
        object_id=ids,
    )
