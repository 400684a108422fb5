"""Which boxes are in each other: vehicles, walkers and props, upright ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import brief_kernel, device
from carstage_sim.world.columns import Touch
from carstage_sim.world.contacts.separating_axes import least_way_out

FloatArray = NDArray[np.float64]

TOWN = -1
"""Stands for the second body of a contact with the town."""

_NORMAL_X, _NORMAL_Y, _DEPTH, _POINT_X, _POINT_Y = map(int, Touch)
_ROUNDING_M = 1e-9


@dataclass(frozen=True, slots=True)
class Contact:
    """Two boxes that are in each other.

    Attributes:
        first, second: their rows; the second may be :data:`TOWN`.
        normal: unit vector in the plane from the first to the second, along the least way out.
        depth_m: length of that way.
        point: where they touch, ``(2,)`` world metres.
        object_id: level object of the town that is touched, 0 for none.
        label: its semantic label.
    """

    first: int
    second: int
    normal: FloatArray
    depth_m: float
    point: FloatArray
    object_id: int = 0
    label: int = 0


def axes_of(yaw_rad: FloatArray) -> FloatArray:
    """``(N, 2, 2)`` forward and right unit vectors of headings."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.stack([np.stack([cosine, sine], -1), np.stack([-sine, cosine], -1)], axis=1)


def find_contacts(
    center: FloatArray, half_size: FloatArray, yaw_rad: FloatArray, span: FloatArray
) -> list[Contact]:
    """All pairs of overlapping boxes, by separating axes, in ascending order of their rows.

    Args:
        center: ``(N, 2 or 3)`` centres of the boxes, seen from above.
        half_size: ``(N, 2)`` half length and half width, metres.
        yaw_rad: ``(N,)`` headings.
        span: ``(N, 2)`` heights of their undersides and tops, world metres.
    """
    radius = np.hypot(half_size[:, 0], half_size[:, 1])
    order = np.argsort(center[:, 0] - radius, kind="stable")
    capacity = 4 * len(order)
    while True:
        pairs, shapes = np.empty((capacity, 2), np.int64), np.empty((capacity, 5))
        count = _touching(
            center, half_size, span, radius, np.cos(yaw_rad), np.sin(yaw_rad), order, pairs, shapes
        )
        if count <= capacity:
            break
        capacity = count
    pairs, shapes = pairs[:count], shapes[:count]
    ascending = np.lexsort((pairs[:, 1], pairs[:, 0])).tolist()
    return [
        Contact(
            int(pairs[k, 0]),
            int(pairs[k, 1]),
            shape[: Touch.DEPTH],
            float(shape[Touch.DEPTH]),
            shape[Touch.POINT_X :],
        )
        for k, shape in zip(ascending, shapes[ascending], strict=True)
    ]


@brief_kernel
def _touching(  # type: ignore[no-untyped-def]
    center, half_size, span, radius, cosine, sine, order, pairs, shapes
):
    """Writes all pairs that touch, as far as there is room; returns how many there are.

    Args:
        radius: ``(N,)`` of the circles around the boxes.
        order: ``(N,)`` rows by the lower ends of these circles along x, which are swept.
        pairs: ``(C, 2)`` rows of a pair, the lower one first.
        shapes: ``(C, 5)`` its normal, depth and point.
    """
    count = 0
    for i in range(order.shape[0]):
        one = order[i]
        high = center[one, 0] + radius[one]
        for k in range(i + 1, order.shape[0]):
            other = order[k]
            if center[other, 0] - radius[other] > high:
                break
            first, second = min(one, other), max(one, other)
            dx = center[second, 0] - center[first, 0]
            dy = center[second, 1] - center[first, 1]
            reach = radius[first] + radius[second]
            if dx * dx + dy * dy >= reach * reach:
                continue
            if span[first, 1] <= span[second, 0] or span[second, 1] <= span[first, 0]:
                continue
            depth, normal_x, normal_y = least_way_out(
                dx, dy,
                cosine[first], sine[first], half_size[first, 0], half_size[first, 1],
                cosine[second], sine[second], half_size[second, 0], half_size[second, 1],
            )  # fmt: skip
            if not depth > 0.0:
                continue
            if count < pairs.shape[0]:
                pairs[count, 0], pairs[count, 1] = first, second
                shapes[count, _NORMAL_X] = normal_x
                shapes[count, _NORMAL_Y] = normal_y
                shapes[count, _DEPTH] = depth
                shapes[count, _POINT_X], shapes[count, _POINT_Y] = _touching_point(
                    center, half_size, cosine, sine, first, second
                )
            count += 1
    return count


@device
def _touching_point(  # type: ignore[no-untyped-def]
    center, half_size, cosine, sine, first, second
):
    """Middle of the corners of either box that are in the other one.

    Boxes that cross without a corner in each other touch in the middle between their centres.
    """
    total_x, total_y, count = 0.0, 0.0, 0
    for side in range(2):
        one, other = (first, second) if side == 0 else (second, first)
        for corner in range(4):
            along = half_size[one, 0] if corner < 2 else -half_size[one, 0]
            across = half_size[one, 1] if corner % 2 == 0 else -half_size[one, 1]
            x = center[one, 0] + along * cosine[one] - across * sine[one]
            y = center[one, 1] + along * sine[one] + across * cosine[one]
            dx, dy = x - center[other, 0], y - center[other, 1]
            if (
                abs(dx * cosine[other] + dy * sine[other]) <= half_size[other, 0] + _ROUNDING_M
                and abs(dy * cosine[other] - dx * sine[other]) <= half_size[other, 1] + _ROUNDING_M
            ):
                total_x += x
                total_y += y
                count += 1
    if count == 0:
        return (
            0.5 * (center[first, 0] + center[second, 0]),
            0.5 * (center[first, 1] + center[second, 1]),
        )
    return total_x / count, total_y / count
