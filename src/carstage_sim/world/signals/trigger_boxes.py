"""Volumes on the road that vehicles drive into, and which vehicle's body is in which."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import brief_kernel
from carstage_sim.maps.town import OrientedBox
from carstage_sim.world.columns import Rotation
from carstage_sim.world.contacts.separating_axes import least_way_out

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
        yaw_rad = np.radians(
            np.array([box.rotation_deg[Rotation.YAW] for _, box in pairs], np.float64)
        )
        self._cosine, self._sine = np.cos(yaw_rad), np.sin(yaw_rad)

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
        _find_owners(
            center, half_size, np.cos(yaw_rad), np.sin(yaw_rad),
            self._owner, self._center, self._extent, self._cosine, self._sine, found,
        )  # fmt: skip
        return found


@brief_kernel
def _find_owners(  # type: ignore[no-untyped-def]
    center, half_size, cosine, sine, owner, box_center, box_extent, box_cosine, box_sine, found
):
    """Writes the owner of the box that each body overlaps farthest ahead."""
    for i in range(center.shape[0]):
        farthest = -np.inf
        for k in range(owner.shape[0]):
            dx, dy = box_center[k, 0] - center[i, 0], box_center[k, 1] - center[i, 1]
            reach = half_size[i, 0] + half_size[i, 1] + box_extent[k, 0] + box_extent[k, 1]
            if abs(dx) >= reach or abs(dy) >= reach:
                continue
            level = abs(box_center[k, 2] - center[i, 2] - _HALF_HEIGHT_OF_BODY_M)
            if level >= box_extent[k, 2] + _HALF_HEIGHT_OF_BODY_M:
                continue
            depth, _, _ = least_way_out(
                dx, dy, cosine[i], sine[i], half_size[i, 0], half_size[i, 1],
                box_cosine[k], box_sine[k], box_extent[k, 0], box_extent[k, 1],
            )  # fmt: skip
            ahead = cosine[i] * dx + sine[i] * dy
            if depth > 0.0 and ahead >= farthest:
                found[i], farthest = owner[k], ahead
