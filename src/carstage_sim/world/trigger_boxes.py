"""Volumes on the road that vehicles drive into, and which vehicle's body is in which."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import OrientedBox

FloatArray = NDArray[np.float64]

_HALF_HEIGHT_OF_BODY_M = 0.75


class TriggerBoxes:
    """Upright boxes, each of which belongs to something by its index.

    Args:
        boxes: owner and box; several boxes may have one owner.
    """

    def __init__(self, boxes: Iterable[tuple[int, OrientedBox]]) -> None:
        pairs = list(boxes)
        self._owner = np.array([owner for owner, _ in pairs], np.int32)
        self._center = np.array([box.center for _, box in pairs], np.float64).reshape(-1, 3)
        self._extent = np.array([box.extent for _, box in pairs], np.float64).reshape(-1, 3)
        self._axes = _axes(np.radians([box.rotation_deg[1] for _, box in pairs]))

    def owners_at(
        self, center: FloatArray, half_size: FloatArray, yaw_rad: FloatArray
    ) -> NDArray[np.int32]:
        """Whose box each vehicle's body overlaps.

        Args:
            center: ``(N, 3)`` middles of the bodies' lower faces, world metres.
            half_size: ``(N, 2)`` half length and half width.
            yaw_rad: ``(N,)``.

        Returns:
            ``(N,)`` the owner of the box that reaches farthest ahead in the vehicle's own
            direction, or -1. Touching is no overlap.
        """
        found = np.full(len(center), -1, np.int32)
        vehicle, box = self._near(center, half_size)
        if not len(vehicle):
            return found
        body_axes = _axes(yaw_rad)[vehicle]
        between = self._center[box, :2] - center[vehicle, :2]
        axes = np.concatenate([body_axes, self._axes[box]], axis=1)
        reach = _reach(axes, body_axes, half_size[vehicle])
        reach += _reach(axes, self._axes[box], self._extent[box, :2])
        apart = np.abs(np.einsum("pak,pk->pa", axes, between)) >= reach
        level = np.abs(self._center[box, 2] - center[vehicle, 2] - _HALF_HEIGHT_OF_BODY_M)
        inside = ~apart.any(axis=1) & (level < self._extent[box, 2] + _HALF_HEIGHT_OF_BODY_M)
        ahead = np.einsum("pk,pk->p", body_axes[:, 0], between)
        for pair in np.flatnonzero(inside)[np.argsort(ahead[inside], kind="stable")]:
            found[vehicle[pair]] = self._owner[box[pair]]
        return found

    def _near(
        self, center: FloatArray, half_size: FloatArray
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Pairs of a vehicle and a box that are close enough to look at."""
        if not len(self._owner) or not len(center):
            return np.zeros(0, np.intp), np.zeros(0, np.intp)
        reach = float(np.linalg.norm(half_size, axis=1).max())
        reach += float(np.linalg.norm(self._extent[:, :2], axis=1).max())
        near = np.abs(center[:, 0, None] - self._center[None, :, 0]) < reach
        near &= np.abs(center[:, 1, None] - self._center[None, :, 1]) < reach
        vehicle, box = np.nonzero(near)
        return vehicle, box


def _axes(yaw_rad: FloatArray) -> FloatArray:
    """``(N, 2, 2)`` forward and right unit vectors in the plane."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.stack([np.stack([cosine, sine], -1), np.stack([-sine, cosine], -1)], axis=1).reshape(
        -1, 2, 2
    )


def _reach(axes: FloatArray, box_axes: FloatArray, half_size: FloatArray) -> FloatArray:
    """``(P, A)`` half extents of boxes along axes ``(P, A, 2)``."""
    return np.asarray(
        np.einsum("pab,pb->pa", np.abs(np.einsum("pak,pbk->pab", axes, box_axes)), half_size)
    )
