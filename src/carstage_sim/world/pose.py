"""Locations and poses as plain values: what commands carry before they reach the arrays."""

from __future__ import annotations

import math
from typing import NamedTuple

from carstage_sim.geometry import pose_matrix, rotation_deg

Vector3 = tuple[float, float, float]
ZERO: Vector3 = (0.0, 0.0, 0.0)


class Pose(NamedTuple):
    """A location in metres and pitch, yaw, roll in degrees, in CARLA's frame."""

    location: Vector3 = ZERO
    rotation_deg: Vector3 = ZERO


def compose(world_from_parent: Pose, parent_from_child: Pose) -> Pose:
    """The child's pose in the world."""
    matrix = pose_matrix(world_from_parent.location, world_from_parent.rotation_deg) @ pose_matrix(
        parent_from_child.location, parent_from_child.rotation_deg
    )
    x, y, z = matrix[:3, 3].tolist()
    pitch, yaw, roll = rotation_deg(matrix[:3, :3]).tolist()
    return Pose((x, y, z), (pitch, yaw, roll))


def normalised(pose: Pose) -> Pose:
    """The same pose with a pitch within 90 and a yaw and roll within 180 degrees.

    So Unreal reports an actor's rotation, whatever it was set to.
    """
    pitch, yaw, roll = (math.remainder(angle, 360.0) for angle in pose.rotation_deg)
    if abs(pitch) > 90.0:
        pitch = math.copysign(180.0, pitch) - pitch
        yaw, roll = math.remainder(yaw + 180.0, 360.0), math.remainder(roll + 180.0, 360.0)
    return pose._replace(rotation_deg=(pitch, yaw, roll))
