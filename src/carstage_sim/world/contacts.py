"""Which boxes are in each other: vehicles, walkers and props, seen from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.cell_index import ranges

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

TOWN = -1
"""Stands for the second body of a contact with the town."""

_SAME_LEVEL_M = 2.0
_CORNERS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])


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


def find_contacts(center: FloatArray, half_size: FloatArray, yaw_rad: FloatArray) -> list[Contact]:
    """All pairs of overlapping boxes, by separating axes, in ascending order of their rows.

    Args:
        center: ``(N, 3)`` centres of the boxes; those more than 2 m apart in height never touch.
        half_size: ``(N, 2)`` half length and half width, metres.
        yaw_rad: ``(N,)`` headings.
    """
    first, second = _near_pairs(center, np.linalg.norm(half_size, axis=1))
    if len(first) == 0:
        return []
    axes = axes_of(yaw_rad)
    between = center[second, :2] - center[first, :2]
    candidates = np.concatenate([axes[first], axes[second]], axis=1)
    reach_along = np.zeros(candidates.shape[:2])
    for rows in (first, second):
        projected = np.abs(np.einsum("pak,pbk->pab", candidates, axes[rows]))
        reach_along += np.einsum("pab,pb->pa", projected, half_size[rows])
    distance = np.einsum("pak,pk->pa", candidates, between)
    depth = reach_along - np.abs(distance)
    best = depth.argmin(axis=1)
    pairs = np.arange(len(first))
    least = depth[pairs, best]
    sign = np.where(distance[pairs, best] < 0.0, -1.0, 1.0)
    normal = candidates[pairs, best] * sign[:, None]
    touching = np.flatnonzero(least > 0.0)
    first, second = first[touching], second[touching]
    points = _touching_points(center, half_size, axes, first, second)
    return [
        Contact(i, j, normal[k], depth_m, point)
        for i, j, k, depth_m, point in zip(
            first.tolist(), second.tolist(), touching, least[touching].tolist(), points, strict=True
        )
    ]


def _near_pairs(center: FloatArray, radius: FloatArray) -> tuple[IntArray, IntArray]:
    """Pairs of circles that overlap, the lower row first, in ascending order (sweep along x)."""
    low = center[:, 0] - radius
    order = np.argsort(low, kind="stable")
    sorted_low = low[order]
    last = np.searchsorted(sorted_low, (center[:, 0] + radius)[order], side="right")
    begin = np.arange(1, len(order) + 1)
    count = np.maximum(last - begin, 0)
    one = order[np.repeat(begin - 1, count)]
    other = order[ranges(begin, count)]
    first, second = np.minimum(one, other), np.maximum(one, other)
    offset = center[second] - center[first]
    near = (offset[:, 0] ** 2 + offset[:, 1] ** 2) < (radius[first] + radius[second]) ** 2
    near &= np.abs(offset[:, 2]) < _SAME_LEVEL_M
    first, second = first[near], second[near]
    ascending = np.lexsort((second, first))
    return first[ascending], second[ascending]


def _touching_points(
    center: FloatArray,
    half_size: FloatArray,
    axes: FloatArray,
    first: IntArray,
    second: IntArray,
) -> FloatArray:
    """``(P, 2)`` middles of the corners of either box of each pair that are in the other one.

    Boxes that cross without a corner in each other touch in the middle between their centres.
    """
    total, count = np.zeros((len(first), 2)), np.zeros(len(first))
    for one, other in ((first, second), (second, first)):
        reach = _CORNERS * half_size[one][:, None]
        corners = center[one, None, :2] + np.einsum("pca,pak->pck", reach, axes[one])
        local = np.einsum("pck,pak->pca", corners - center[other, None, :2], axes[other])
        inside = (np.abs(local) <= half_size[other][:, None] + 1e-9).all(axis=2)
        total += (corners * inside[..., None]).sum(axis=1)
        count += inside.sum(axis=1)
    between = 0.5 * (center[first, :2] + center[second, :2])
    some = (count > 0.0)[:, None]
    return np.where(some, total / np.maximum(count, 1.0)[:, None], between)
