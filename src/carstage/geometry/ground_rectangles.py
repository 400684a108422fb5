"""Rectangles on the ground: how far apart two are, whether they overlap, and when they will.

Two convex shapes are apart where, along the normal of some side, their shadows are (separating
axis theorem; Gottschalk, Lin, Manocha, "OBBTree", SIGGRAPH 1996).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage.geometry.coordinates import FloatArray


@dataclass(frozen=True, slots=True)
class Rectangles:
    """The rectangles of one object, one for each tick.

    Attributes:
        center: ``(N, 2)`` m.
        heading: ``(N, 2)`` unit vector along its length.
        half: ``(N, 2)`` half length and half width, m.
        velocity: ``(N, 2)`` m/s.
    """

    center: FloatArray
    heading: FloatArray
    half: FloatArray
    velocity: FloatArray

    @property
    def axes(self) -> FloatArray:
        """``(N, 2, 2)`` unit vectors along length and width, as rows."""
        x, y = self.heading[:, 0], self.heading[:, 1]
        return np.stack([self.heading, np.stack([-y, x], axis=-1)], axis=1)

    @property
    def corners(self) -> FloatArray:
        """``(N, 4, 2)``."""
        along, across = np.moveaxis(self.axes * self.half[:, :, None], 1, 0)
        turns = ((1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0))
        return np.stack([self.center + a * along + b * across for a, b in turns], axis=1)


def overlap(one: Rectangles, other: Rectangles) -> NDArray[np.bool_]:
    """``(N,)`` whether they overlap or touch."""
    apart, reach, _ = _shadows(one, other)
    return np.asarray((np.abs(apart) <= reach).all(axis=1))


def distance_m(one: Rectangles, other: Rectangles) -> FloatArray:
    """``(N,)`` from the border of one to that of the other; 0 where they overlap."""
    # Between shapes that are apart, a corner of one of them is at an end of the shortest line.
    nearest = np.minimum(_corners_to(one, other), _corners_to(other, one))
    return np.where(overlap(one, other), 0.0, nearest)


def time_to_collision_s(one: Rectangles, other: Rectangles) -> FloatArray:
    """``(N,)`` until they touch if both go on straight at their velocities; infinite: never."""
    apart, reach, speed = _shadows(one, other)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(-reach - apart) / speed, (reach - apart) / speed])
    still = speed == 0.0
    within = np.abs(apart) <= reach
    enter = np.where(still, np.where(within, -np.inf, np.inf), ends.min(axis=0)).max(axis=1)
    leave = np.where(still, np.where(within, np.inf, -np.inf), ends.max(axis=0)).min(axis=1)
    return np.where((enter <= leave) & (leave >= 0.0), np.maximum(enter, 0.0), np.inf)


def _shadows(one: Rectangles, other: Rectangles) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Along the four normals: ``(N, 4)`` middles' distance, sum of half shadows, rate of change."""
    normals = np.concatenate([one.axes, other.axes], axis=1)
    reach = np.zeros(normals.shape[:2])
    for each in (one, other):
        for side in range(2):
            reach += np.abs(_dot(normals, each.axes[:, side, None])) * each.half[:, side, None]
    apart = _dot(normals, (other.center - one.center)[:, None])
    return apart, reach, _dot(normals, (other.velocity - one.velocity)[:, None])


def _corners_to(one: Rectangles, other: Rectangles) -> FloatArray:
    """``(N,)`` from the corners of one to the other, the least."""
    offset = one.corners - other.center[:, None, :]
    along, across = (
        np.maximum(np.abs(_dot(offset, other.axes[:, side, None])) - other.half[:, side, None], 0.0)
        for side in range(2)
    )
    return np.asarray(np.sqrt(along**2 + across**2).min(axis=1))


def _dot(one: FloatArray, other: FloatArray) -> FloatArray:
    """Scalar products along the last axis of two numbers, term by term: no BLAS rounds them."""
    return np.asarray(one[..., 0] * other[..., 0] + one[..., 1] * other[..., 1])
