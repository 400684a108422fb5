"""Curved shapes: monotone curves, grids of points, lathes and limbs, with smoothed normals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage_sim.content.solids import quads_to_triangles
from carstage_sim.mesh import Material, TriangleMesh, build_mesh

Array = NDArray[np.float64]


class Curve:
    """A smooth curve through control points that overshoots none of them.

    Cubic Hermite pieces with the slopes of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 1984);
    constant before the first and behind the last point.

    Args:
        points: ``(x, y)`` with rising x.
    """

    def __init__(self, points: Sequence[tuple[float, float]]) -> None:
        self._x = np.array([p[0] for p in points], np.float64)
        self._y = np.array([p[1] for p in points], np.float64)
        if len(points) < 2 or np.any(np.diff(self._x) <= 0):
            raise ValueError(f"a curve needs at least two points of rising x, not {points}")
        step = np.diff(self._x)
        slope = np.diff(self._y) / step
        inner = np.zeros(len(slope) - 1)
        same = slope[:-1] * slope[1:] > 0
        weight = (step[:-1] + 2 * step[1:]) / (3 * (step[:-1] + step[1:]))
        mixed = weight * slope[1:] + (1 - weight) * slope[:-1]
        inner[same] = (slope[:-1] * slope[1:])[same] / mixed[same]
        self._slope = np.concatenate([slope[:1], inner, slope[-1:]])

    def __call__(self, x: ArrayLike) -> Array:
        """Values at ``x``."""
        at = np.clip(np.asarray(x, np.float64), self._x[0], self._x[-1])
        i = np.clip(np.searchsorted(self._x, at, side="right") - 1, 0, len(self._x) - 2)
        step = self._x[i + 1] - self._x[i]
        t = (at - self._x[i]) / step
        value: Array = (
            (1 + 2 * t) * (1 - t) ** 2 * self._y[i]
            + t * (1 - t) ** 2 * step * self._slope[i]
            + t * t * (3 - 2 * t) * self._y[i + 1]
            + t * t * (t - 1) * step * self._slope[i + 1]
        )
        return value


def smooth_normals(vertices: Array, triangles: NDArray[np.int32], crease_deg: float) -> Array:
    """``(T, 3, 3)`` corner normals: mean of the faces around a corner within the crease angle.

    Vertices at the same place count as one; faces count by their area.
    """
    corners = vertices[triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = face / np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-15)
    _, place = np.unique(np.round(vertices, 5), axis=0, return_inverse=True)
    flat = place.reshape(-1)[triangles].reshape(-1)
    order = np.argsort(flat, kind="stable")
    _, start, count = np.unique(flat[order], return_index=True, return_counts=True)
    # All pairs (corner, face around the same place).
    own = np.repeat(order, np.repeat(count, count))
    repeats = np.repeat(count, count)
    first = np.repeat(np.repeat(start, count), repeats)
    within = np.arange(len(own)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
    other = order[first + within] // 3
    near = np.einsum("ij,ij->i", unit[own // 3], unit[other]) > np.cos(np.radians(crease_deg))
    normals = np.zeros((len(flat), 3))
    for axis in range(3):
        normals[:, axis] = np.bincount(
            own[near], weights=face[other[near], axis], minlength=len(flat)
        )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    flat_unit = np.repeat(unit, 3, axis=0)
    normals = np.where(length > 1e-15, normals / np.maximum(length, 1e-15), flat_unit)
    return normals.reshape(-1, 3, 3)


class ShapeBuilder:
    """Collects surfaces and makes one mesh of them.

    Args:
        tag: semantic label of what is added unless told otherwise.
        coarse: whether shapes that know two levels of detail are to be of the lower one.

    Attributes:
        wheels: numbers of the first triangle of each wheel and of the first behind it.
    """

    def __init__(self, tag: int, *, coarse: bool = False) -> None:
        self.coarse = coarse
        self._tag = tag
        self.wheels: list[tuple[int, int]] = []
        self._vertices: list[Array] = []
        self._triangles: list[NDArray[np.int32]] = []
        self._normals: list[Array] = []
        self._materials: list[NDArray[np.uint8]] = []
        self._tags: list[NDArray[np.uint8]] = []
        self._count = 0

    def add(
        self,
        vertices: ArrayLike,
        triangles: ArrayLike,
        material: int | NDArray[np.integer],
        *,
        tag: int | None = None,
        crease_deg: float = 40.0,
    ) -> None:
        """Add triangles of ``vertices (V, 3)``; degenerate ones are left out."""
        points = np.asarray(vertices, np.float64).reshape(-1, 3)
        index = np.asarray(triangles, np.int32).reshape(-1, 3)
        materials = np.broadcast_to(np.asarray(material, np.uint8), (len(index),))
        corners = points[index]
        area = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        solid = area > 1e-9
        index, materials = index[solid], materials[solid]
        if not len(index):
            return
        self._vertices.append(points)
        self._triangles.append((index + np.int32(self._count)).astype(np.int32))
        self._normals.append(smooth_normals(points, index, crease_deg))
        self._materials.append(materials)
        self._tags.append(np.full(len(index), self._tag if tag is None else tag, np.uint8))
        self._count += len(points)

    def grid(
        self,
        points: ArrayLike,
        material: int | NDArray[np.integer],
        *,
        closed: bool = False,
        tag: int | None = None,
        crease_deg: float = 40.0,
    ) -> None:
        """Add a surface through ``(R, C, 3)`` points.

        Args:
            points: rows of points.
            material: one, or ``(R - 1, C - 1)`` (``(R - 1, C)`` when closed) of the quads.
            closed: join the last column to the first.
            tag: semantic label.
            crease_deg: faces that meet at a larger angle keep a visible edge.
        """
        p = np.asarray(points, np.float64)
        rows, columns = p.shape[:2]
        if closed:
            p = np.concatenate([p, p[:, :1]], axis=1)
            columns += 1
        number = np.arange(rows * columns).reshape(rows, columns)
        quads = np.stack(
            [number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1
        )
        per_quad = np.broadcast_to(np.asarray(material), quads.shape[:2]).reshape(-1)
        self.add(
            p.reshape(-1, 3),
            quads_to_triangles(quads),
            np.repeat(per_quad, 2),
            tag=tag,
            crease_deg=crease_deg,
        )

    def lathe(
        self,
        center: ArrayLike,
        profile: Sequence[tuple[float, float]],
        materials: NDArray[np.integer],
        *,
        segments: int,
        tag: int | None = None,
    ) -> None:
        """Add a body turned about the y axis through ``center``.

        Args:
            center: point on the axis.
            profile: ``(radius, y)`` of each ring, from one end to the other.
            materials: ``(len(profile) - 1, segments)`` of the quads.
            segments: quads around.
            tag: semantic label.
        """
        angle = np.linspace(0.0, 2 * np.pi, segments, endpoint=False)
        radius = np.array([p[0] for p in profile])[:, None]
        along = np.array([p[1] for p in profile])[:, None] + 0 * angle
        points = np.stack([radius * np.cos(angle), along, radius * np.sin(angle)], axis=-1)
        self.grid(
            points + np.asarray(center, np.float64), materials, closed=True, tag=tag, crease_deg=35
        )

    def limb(
        self,
        path: ArrayLike,
        radii: ArrayLike,
        material: int,
        *,
        sides: int = 8,
        squash: float = 1.0,
        tag: int | None = None,
    ) -> None:
        """Add a tapered tube with closed ends; its ring is ``squash`` times as deep (x) as wide.

        Args:
            path: ``(N, 3)`` points of the middle line.
            radii: ``(N,)`` half widths.
            material: of all faces.
            sides: quads around.
            squash: depth over width of a ring.
            tag: semantic label.
        """
        line = np.asarray(path, np.float64)
        radius = np.asarray(radii, np.float64)
        along = np.gradient(line, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        helper = np.where(
            np.abs(along[:, :1]) < 0.9, np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
        )
        side = np.cross(along, helper)
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        depth = np.cross(side, along)
        angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
        ring = (
            np.cos(angle)[None, :, None] * side[:, None]
            + np.sin(angle)[None, :, None] * depth[:, None] * squash
        ) * radius[:, None, None] + line[:, None]
        first = np.broadcast_to(line[:1, None], (1, sides, 3))
        last = np.broadcast_to(line[-1:, None], (1, sides, 3))
        self.grid(
            np.concatenate([first, ring, last]), material, closed=True, tag=tag, crease_deg=70
        )

    def box(
        self, low: ArrayLike, high: ArrayLike, material: int, *, tag: int | None = None
    ) -> None:
        """Add an upright box from its lowest to its highest corner."""
        ends = np.stack([np.asarray(low, np.float64), np.asarray(high, np.float64)])
        corner = np.array([[ends[(k >> a) & 1, a] for a in range(3)] for k in range(8)])
        quads = np.array(
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        )
        self.add(corner, quads_to_triangles(quads), material, tag=tag, crease_deg=10)

    @contextmanager
    def wheel(self) -> Iterator[None]:
        """What is added in the block is one wheel."""
        first = sum(map(len, self._triangles))
        yield
        self.wheels.append((first, sum(map(len, self._triangles))))

    def mesh(self) -> TriangleMesh:
        """All that was added."""
        return build_mesh(
            np.concatenate(self._vertices),
            np.concatenate(self._triangles),
            np.concatenate(self._materials),
            np.concatenate(self._tags),
            normals=np.concatenate(self._normals),
        )


def uniform(material: Material, *shape: int) -> NDArray[np.uint8]:
    """An array of one material, to be painted over in parts."""
    return np.full(shape, material, np.uint8)
