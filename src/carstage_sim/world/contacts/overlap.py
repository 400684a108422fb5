"""Whether upright boxes overlap: the test that refuses a spawn onto another actor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import FloatArray, rotation_matrix
from carstage_sim.world.actors import ActorTable
from carstage_sim.world.blueprints import Blueprint
from carstage_sim.world.columns import Rotation
from carstage_sim.world.pose import Pose


def footprint_corners(
    center: FloatArray, extent: FloatArray, yaw_deg: FloatArray
) -> NDArray[np.float64]:
    """``(..., 4, 2)`` ground corners of boxes turned by their yaw alone."""
    yaw = np.radians(yaw_deg)
    forward = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1) * extent[..., 0:1]
    right = np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1) * extent[..., 1:2]
    middle = center[..., :2]
    corners: NDArray[np.float64] = np.stack(
        [
            middle + forward + right,
            middle + forward - right,
            middle - forward - right,
            middle - forward + right,
        ],
        axis=-2,
    )
    return corners


def overlaps(
    center: FloatArray,
    extent: FloatArray,
    yaw_deg: float,
    centers: FloatArray,
    extents: FloatArray,
    yaws_deg: FloatArray,
) -> NDArray[np.bool_]:
    """Which of N boxes overlap one box (separating axes in the plane, intervals in height).

    Args:
        center, extent, yaw_deg: the box: ``(3,)`` centre and half sizes in metres, degrees.
        centers, extents, yaws_deg: ``(N, 3)``, ``(N, 3)``, ``(N,)``.

    Returns:
        ``(N,)`` bool; touching is no overlap.
    """
    if not len(centers):
        return np.zeros(0, np.bool_)
    one = footprint_corners(center, extent, np.asarray(yaw_deg))[None]
    many = footprint_corners(centers, extents, yaws_deg)
    hit: NDArray[np.bool_] = np.abs(centers[:, 2] - center[2]) < extents[:, 2] + extent[2]
    sides = [box[:, 0] - box[:, corner] for box in (one, many) for corner in (1, 3)]
    for axis in sides:
        of_one = (one * axis[:, None]).sum(axis=-1)
        of_many = (many * axis[:, None]).sum(axis=-1)
        hit &= (of_one.max(axis=1) > of_many.min(axis=1)) & (
            of_many.max(axis=1) > of_one.min(axis=1)
        )
    return hit


def is_blocked(table: ActorTable, blueprint: Blueprint, pose: Pose) -> bool:
    """Whether an actor that collides stands where another is to be spawned.

    Scenery does not count: a tree's box is mostly air, and spawn points are free of walls.
    """
    others = [actor for actor in table if actor.collides]
    if not others:
        return False
    rows = table.rows(actor.actor_id for actor in others)
    rotations = table.rotation_deg[rows]
    offsets = np.array([actor.box_center for actor in others])
    centers = table.location[rows] + np.einsum("nij,nj->ni", rotation_matrix(rotations), offsets)
    offset = rotation_matrix(pose.rotation_deg) @ np.asarray(blueprint.box_center)
    hit = overlaps(
        np.asarray(pose.location) + offset,
        np.asarray(blueprint.box_extent),
        pose.rotation_deg[Rotation.YAW],
        centers,
        np.array([actor.box_extent for actor in others]),
        rotations[:, Rotation.YAW],
    )
    return bool(hit.any())
