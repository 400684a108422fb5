"""Oriented boxes: corners, edges and containment, in LibCarla's order."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from carstage.geometry.coordinates import FloatArray, multiply, pose_matrix, rotate

CORNER_SIGNS: Final = np.array(
    [[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
)
"""``(8, 3)`` signs of the corners along forward, right, up (``get_local_vertices``)."""

EDGES: Final[tuple[tuple[int, int], ...]] = tuple(
    (a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit
)
"""The 12 edges as pairs of corner indices, lower index first."""


def world_from_box(
    actor_location_m: ArrayLike,
    actor_rotation_deg: ArrayLike,
    box_location_m: ArrayLike,
    box_rotation_deg: ArrayLike,
) -> FloatArray:
    """Pose of an actor's box, ``(..., 4, 4)``: actor pose times the box's pose in the actor.

    The box's own location counts once: the actor's location is its pivot, not the box's centre.
    """
    actor = pose_matrix(actor_location_m, actor_rotation_deg)
    return multiply(actor, pose_matrix(box_location_m, box_rotation_deg))


def box_corners(parent_from_box: ArrayLike, extent_m: ArrayLike) -> FloatArray:
    """Corners ``(..., 8, 3)`` in the parent frame.

    Args:
        parent_from_box: ``(..., 4, 4)`` poses.
        extent_m: ``(..., 3)`` half length, half width, half height.
    """
    pose = np.asarray(parent_from_box, dtype=np.float64)
    local = CORNER_SIGNS * np.asarray(extent_m, dtype=np.float64)[..., None, :]
    return rotate(pose[..., None, :3, :3], local) + pose[..., None, :3, 3]
