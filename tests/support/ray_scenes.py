"""Small scenes and an independent ray caster in double precision to compare with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh
from carstage_sim.render.caster import Hits, RayCaster
from carstage_sim.render.scene import Frame, Placement, SceneStore

Array = NDArray[np.float64]


def soup(corners: Array, *, leafy: bool = False) -> TriangleMesh:
    """A mesh of separate triangles ``(T, 3, 3)``; ``leafy``: two of three are cards of leaves."""
    points = np.asarray(corners, np.float64).reshape(-1, 3)
    index = np.arange(len(points)).reshape(-1, 3)
    kinds = np.array([Material.DEFAULT, Material.LEAVES, Material.NEEDLES])
    material = kinds[np.arange(len(index)) % 3 if leafy else np.zeros(len(index), int)]
    return build_mesh(points, index, material, CityObjectLabel.STATIC)


def sphere(subdivisions: int) -> TriangleMesh:
    """A closed unit sphere of shared vertices: an octahedron, refined."""
    vertices = np.concatenate([np.eye(3), -np.eye(3)])
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    points = [tuple(v) for v in vertices]
    for _ in range(subdivisions):
        middle: dict[tuple[int, int], int] = {}

        def between(a: int, b: int, known: dict[tuple[int, int], int] = middle) -> int:
            key = (min(a, b), max(a, b))
            if key not in known:
                point = np.add(points[a], points[b])
                points.append(tuple(point / np.linalg.norm(point)))
                known[key] = len(points) - 1
            return known[key]

        finer = []
        for a, b, c in faces:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = finer
    return build_mesh(np.array(points), np.array(faces), Material.DEFAULT, CityObjectLabel.STATIC)


def turned_box(size: tuple[float, float, float]) -> TriangleMesh:
    """A box around the origin."""
    corner = np.array([[(k >> a) & 1 for a in range(3)] for k in range(8)], np.float64)
    quads = np.array(
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    )
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return build_mesh((corner - 0.5) * size, triangles, Material.PAINT, CityObjectLabel.CAR)


def frame_of(
    static: TriangleMesh | None,
    placements: list[Placement] | None = None,
    models: dict[str, TriangleMesh] | None = None,
) -> Frame:
    """A frame without anything on disk."""
    return SceneStore(static, (models or {}).__getitem__, cache=None).frame(placements or [])


def shoot(
    frame: Frame,
    origin: Array,
    directions: Array,
    *,
    low: float = 1e-4,
    high: float = 1e4,
    skip_row: int = -1,
) -> Hits:
    """Nearest hits with one thread."""
    caster = RayCaster(1)
    rays = np.asarray(directions, np.float32).reshape(-1, 3)
    return caster.cast(frame.scene, np.asarray(origin), rays, low=low, high=high, skip_row=skip_row)


def moller_trumbore(
    corners: Array, origin: Array, directions: Array
) -> tuple[Array, NDArray[np.int64], Array]:
    """Nearest parameter, triangle, and how clear the case is, in float64.

    The last is the least of: distance to an edge in barycentric weight, distance along the ray to
    the next triangle, and how far the ray is from lying in a triangle's plane.
    """
    a, b, c = (corners[None, :, k] for k in range(3))
    d = np.asarray(directions, np.float64)[:, None]
    p = np.cross(d, c - a)
    det = ((b - a) * p).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.asarray(origin, np.float64) - a
        u = (s * p).sum(-1) / det
        q = np.cross(s, b - a)
        v = (d * q).sum(-1) / det
        t = ((c - a) * q).sum(-1) / det
    weight = np.minimum(np.minimum(u, v), 1 - u - v)
    good = (weight >= 0) & (t > 1e-4) & np.isfinite(t)
    reach = np.where(good, t, np.inf)
    nearest = reach.argmin(axis=1)
    rows = np.arange(len(reach))
    clear = np.where(np.isfinite(weight) & (t > 1e-4), np.abs(weight), np.inf).min(axis=1)
    if reach.shape[1] > 1:
        two = np.sort(reach, axis=1)[:, :2]
        with np.errstate(invalid="ignore"):
            clear = np.fmin(clear, np.where(np.isfinite(two[:, 1]), two[:, 1] - two[:, 0], np.inf))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=-1) * np.linalg.norm(d, axis=-1)
    clear = np.minimum(clear, (np.abs(det) / area).min(axis=1) * 10)
    found = np.where(np.isfinite(reach[rows, nearest]), nearest, -1)
    return reach[rows, nearest], found, clear
