"""Figures as parts that hang on the joints of a pose: shapes are made once, poses move them.

A vertex lies in one frame; a frame sits on a chain of joints, so limbs bend at elbows and knees and
trunks turn between hips and shoulders. The axes of a frame are front, right and along: along leads
from pelvis to neck, down a limb, and up in heads and feet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage_sim.content.lofting import Array
from carstage_sim.content.solids import quads_to_triangles

_BEND_SHARE = 0.2
"""Part of a limb's bone along which it bends towards the next."""
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
REST_TOE = (0.19, -0.05)
"""Tip of a flat foot, ahead of and above its ankle, metres of a figure of 1.8 m."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Joints of a figure in metres; left is -y. Limbs are (left, right).

    Attributes:
        pelvis, neck, head: middle of the pelvis, foot of the neck, middle of the head.
        shoulder, elbow, hand, hip, knee, ankle: one point for each side; hands are wrists.
        toe: tip of each foot.
    """

    pelvis: Array
    neck: Array
    head: Array
    shoulder: tuple[Array, Array]
    elbow: tuple[Array, Array]
    hand: tuple[Array, Array]
    hip: tuple[Array, Array]
    knee: tuple[Array, Array]
    ankle: tuple[Array, Array]
    toe: tuple[Array, Array]


def stacked(poses: Sequence[Pose]) -> Pose:
    """Several poses as one, whose joints are ``(P, 3)``."""

    def pair(name: str) -> tuple[Array, Array]:
        left, right = zip(*(getattr(pose, name) for pose in poses), strict=True)
        return np.stack(left), np.stack(right)

    return Pose(
        pelvis=np.stack([pose.pelvis for pose in poses]),
        neck=np.stack([pose.neck for pose in poses]),
        head=np.stack([pose.head for pose in poses]),
        shoulder=pair("shoulder"), elbow=pair("elbow"), hand=pair("hand"),
        hip=pair("hip"), knee=pair("knee"), ankle=pair("ankle"), toe=pair("toe"),
    )  # fmt: skip


class Chain(IntEnum):
    """What frames sit on.

    ``LEGS`` is between both legs; ``CARRIED`` and ``HELD`` are upright at the left and the right
    wrist.
    """

    TRUNK = 0
    HEAD = 1
    ARM_LEFT = 2
    ARM_RIGHT = 3
    LEG_LEFT = 4
    LEG_RIGHT = 5
    LEGS = 6
    FOOT_LEFT = 7
    FOOT_RIGHT = 8
    CARRIED = 9
    HELD = 10


Anchor = tuple[Chain, float]
"""A chain and the place on it: 0 at the first joint, 1 at the second."""

ARMS = (Chain.ARM_LEFT, Chain.ARM_RIGHT)
LEGS = (Chain.LEG_LEFT, Chain.LEG_RIGHT)
FEET = (Chain.FOOT_LEFT, Chain.FOOT_RIGHT)


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """A figure without a pose.

    Attributes:
        anchors: chain of each frame and the place on it: 0 at the first joint, 1 at the second.
        frame: ``(V,)`` of each vertex.
        offset: ``(V, 3)`` metres from its frame's origin.
        triangles: ``(T, 3)``.
        material: ``(T,)`` uint8.
    """

    anchors: tuple[Anchor, ...]
    frame: NDArray[np.intp]
    offset: Array
    triangles: NDArray[np.int32]
    material: NDArray[np.uint8]

    def vertices(self, pose: Pose) -> Array:
        """``(..., V, 3)`` where the vertices are in a pose, or in each of several."""
        origins, axes = _frames(pose, self.anchors)
        turned = np.einsum("...vij,vj->...vi", axes[..., self.frame, :, :], self.offset)
        placed: Array = origins[..., self.frame, :] + turned
        return placed

    def normals(self, vertices: Array) -> Array:
        """``(T, 3, 3)`` normals at the corners: means of the faces around, by their areas."""
        corner = vertices[self.triangles]
        a, b = (corner[:, k] - corner[:, 0] for k in (1, 2))
        around = np.zeros((len(vertices), 3))
        index = self.triangles.reshape(-1)
        for axis, (one, two) in enumerate(((1, 2), (2, 0), (0, 1))):
            face = a[:, one] * b[:, two] - a[:, two] * b[:, one]
            around[:, axis] = np.bincount(index, np.repeat(face, 3), minlength=len(vertices))
        around /= np.maximum(np.sqrt((around**2).sum(axis=1, keepdims=True)), 1e-15)
        normals: Array = around[self.triangles]
        return normals


class Parts:
    """Collects the parts of a figure.

    Args:
        unit: all offsets are multiplied by it.
    """

    def __init__(self, unit: float) -> None:
        self._unit = unit
        self._anchors: dict[Anchor, int] = {}
        self._frames: list[NDArray[np.intp]] = []
        self._offsets: list[Array] = []
        self._triangles: list[NDArray[np.int32]] = []
        self._materials: list[NDArray[np.uint8]] = []
        self._count = 0

    def loft(
        self,
        anchors: Sequence[Anchor | list[Anchor]],
        rings: ArrayLike,
        material: ArrayLike,
        *,
        closed: bool = True,
        capped: bool = True,
    ) -> None:
        """Add a surface through rings.

        Args:
            anchors: of each ring, or of each of its points.
            rings: ``(R, S, 3)`` offsets: front, right, along.
            material: one, or one for each quad: ``(R - 1, S)``, open ones ``(R - 1, S - 1)``.
            closed: join the last point of a ring to the first.
            capped: close both ends.
        """
        points = np.asarray(rings, np.float64) * self._unit
        rows, columns = points.shape[:2]
        frames = np.empty((rows, columns), np.intp)
        for row, anchor in enumerate(anchors):
            if isinstance(anchor, list):
                frames[row] = [self._frame(one) for one in anchor]
            else:
                frames[row] = self._frame(anchor)
        around = np.arange(columns + 1) % columns if closed else np.arange(columns)
        number = np.arange(rows * columns).reshape(rows, columns)[:, around]
        quads = np.stack(
            [number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1
        )
        per_quad = np.broadcast_to(np.asarray(material, np.uint8), quads.shape[:2])
        triangles = [quads_to_triangles(quads.reshape(-1, 4))]
        materials = [np.repeat(per_quad.reshape(-1), 2)]
        if capped:
            middle = np.arange(1, columns - 1)
            for start, kind in ((0, per_quad[0]), ((rows - 1) * columns, per_quad[-1])):
                fan = np.stack([np.zeros_like(middle), middle, middle + 1], axis=1) + start
                triangles.append(fan if start else fan[:, ::-1])
                materials.append(kind[1 : columns - 1])
        self._add(
            frames.reshape(-1), points.reshape(-1, 3), np.concatenate(triangles),
            np.concatenate(materials),
        )  # fmt: skip

    def box(self, anchor: Anchor, low: ArrayLike, high: ArrayLike, material: int) -> None:
        """Add a box between two corners, with edges that stay sharp."""
        ends = np.stack([np.asarray(low, np.float64), np.asarray(high, np.float64)])
        corner = np.array([[ends[(k >> a) & 1, a] for a in range(3)] for k in range(8)])
        for face in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2),
                     (1, 3, 7, 5)):  # fmt: skip
            quad = corner[list(face)][[[0, 1], [3, 2]]]
            self.loft([anchor] * 2, quad, material, closed=False, capped=False)

    def figure(self) -> Figure:
        """All that was added."""
        return Figure(
            anchors=tuple(self._anchors),
            frame=np.concatenate(self._frames),
            offset=np.concatenate(self._offsets),
            triangles=np.concatenate(self._triangles).astype(np.int32),
            material=np.concatenate(self._materials),
        )

    def _frame(self, anchor: Anchor) -> int:
        return self._anchors.setdefault(anchor, len(self._anchors))

    def _add(
        self,
        frames: NDArray[np.intp],
        offsets: Array,
        triangles: NDArray[np.integer],
        materials: NDArray[np.uint8],
    ) -> None:
        self._frames.append(frames)
        self._offsets.append(offsets)
        self._triangles.append((triangles + self._count).astype(np.int32))
        self._materials.append(materials)
        self._count += len(offsets)


def _unit_vectors(vectors: Array) -> Array:
    length = np.sqrt((vectors**2).sum(axis=-1, keepdims=True))
    unit: Array = vectors / np.maximum(length, 1e-12)
    return unit


def _cross(a: ArrayLike, b: ArrayLike) -> Array:
    """The vector product; numpy's own takes ten times as long for a few vectors."""
    one, two = np.asarray(a, np.float64), np.asarray(b, np.float64)
    product: Array = one[..., _NEXT] * two[..., _LAST] - one[..., _LAST] * two[..., _NEXT]
    return product


def _dot(a: Array, b: Array) -> Array:
    """The scalar product along the last axis, which stays."""
    product: Array = (a * b).sum(axis=-1, keepdims=True)
    return product


def _frames(pose: Pose, anchors: tuple[Anchor, ...]) -> tuple[Array, Array]:
    """Origins ``(..., F, 3)`` and axes ``(..., F, 3, 3)`` (front, right, along) of frames."""
    chains = np.array([int(chain) for chain, _ in anchors])
    places = np.array([place for _, place in anchors])
    shape = (*pose.pelvis.shape[:-1], len(anchors))
    origins, axes = np.empty((*shape, 3)), np.empty((*shape, 3, 3))
    hips = _unit_vectors(pose.hip[1] - pose.hip[0])
    shoulders = _unit_vectors(pose.shoulder[1] - pose.shoulder[0])

    def put(chain: Chain, points: list[Array], right: Array, right_end: Array) -> None:
        (rows,) = np.nonzero(chains == chain)
        if len(rows):
            joints = np.stack(points, axis=-2)
            found = _on_chain(joints, places[rows], right, right_end)
            origins[..., rows, :], axes[..., rows, :, :] = found

    def set_at(rows: NDArray[np.intp], origin: Array, columns: list[Array]) -> None:
        origins[..., rows, :] = origin[..., None, :]
        axes[..., rows, :, :] = np.stack(columns, axis=-1)[..., None, :, :]

    put(Chain.TRUNK, [pose.pelvis, pose.neck], hips, shoulders)
    for side in (0, 1):
        arm = [pose.shoulder[side], pose.elbow[side], pose.hand[side]]
        put(ARMS[side], arm, shoulders, shoulders)
        leg = [pose.hip[side], pose.knee[side], pose.ankle[side]]
        put(LEGS[side], leg, hips, hips)
        (rows,) = np.nonzero(chains == FEET[side])
        set_at(rows, pose.ankle[side], _foot_axes(pose.toe[side] - pose.ankle[side], hips))
    between = [(a + b) / 2 for a, b in (pose.hip, pose.knee, pose.ankle)]
    put(Chain.LEGS, between, hips, hips)
    level = _unit_vectors(hips * np.array([1.0, 1.0, 0.0]))
    upright = np.broadcast_to((0.0, 0.0, 1.0), level.shape)
    for side, chain in enumerate((Chain.CARRIED, Chain.HELD)):
        (rows,) = np.nonzero(chains == chain)
        set_at(rows, pose.hand[side], [_cross(level, upright), level, upright])
    (rows,) = np.nonzero(chains == Chain.HEAD)
    up = _unit_vectors(pose.head - pose.neck)
    right = _unit_vectors(hips + shoulders)
    right = _unit_vectors(right - _dot(right, up) * up)
    set_at(rows, pose.head, [_cross(right, up), right, up])
    return origins, axes


def _on_chain(points: Array, places: Array, right: Array, right_end: Array) -> tuple[Array, Array]:
    """Frames at places of a chain of joints; their right side turns from one way to another.

    Args:
        points: ``(..., J, 3)``.
        places: ``(R,)``, from 0 to J - 1.
        right, right_end: ``(..., 3)``.

    Returns:
        Origins ``(..., R, 3)`` and axes ``(..., R, 3, 3)``.
    """
    bones = np.diff(points, axis=-2)
    count = bones.shape[-2]
    ways = _unit_vectors(bones)
    bone = np.clip(np.floor(places).astype(int), 0, count - 1)
    origins = points[..., bone, :] + (places - bone)[:, None] * bones[..., bone, :]
    along = ways[..., bone, :]
    for joint in range(1, count):
        share = np.clip((places - joint + _BEND_SHARE) / (2 * _BEND_SHARE), 0.0, 1.0)[:, None]
        near = np.abs(places - joint) < _BEND_SHARE
        before, after = ways[..., joint - 1 : joint, :], ways[..., joint : joint + 1, :]
        bent = _unit_vectors(before * (1 - share) + after * share)
        along = np.where(near[:, None], bent, along)
    turn = np.clip(places / count, 0.0, 1.0)[:, None]
    aside = right[..., None, :] * (1 - turn) + right_end[..., None, :] * turn
    # Trunks rise, limbs hang: in both, what is in front of a standing figure is its front.
    front = _cross(aside, along) if count == 1 else _cross(along, aside)
    ahead = np.array([1.0, 0.0, 0.0]) - along * along[..., :1]
    sideways = (front**2).sum(axis=-1, keepdims=True) < 0.1
    front = _unit_vectors(np.where(sideways, ahead, front))
    side = _cross(along, front) if count == 1 else _cross(front, along)
    return origins, np.stack([front, side, along], axis=-1)


def _foot_axes(toe: Array, right: Array) -> list[Array]:
    """Front, right and upper side of a foot from the way of its toes, each ``(..., 3)``."""
    line = _unit_vectors(toe)
    side = _unit_vectors(right - _dot(right, line) * line)
    above = _cross(line, side)
    flat = np.array(REST_TOE) / np.hypot(*REST_TOE)
    # In a flat foot the toes are lower than the ankle.
    front = flat[0] * line - flat[1] * above
    up = flat[1] * line + flat[0] * above
    return [front, side, up]
