"""Attachment kinds, and the arm that carries a camera behind its parent (``USpringArmComponent``).

CARLA's spring arms (``ActorAttacher.cpp`` of its plugin) take the place that a script names as the
arm's far end, look along the arm, stay level while the parent pitches and rolls, and turn after the
parent's heading with a lag. The script's rotation is added to the arm's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from carstage_sim.geometry import FloatArray, pose_matrix, rotation_deg, rotation_matrix
from carstage_sim.world.pose import Pose, Vector3

_LAG_PER_S = 8.0
_LONGEST_LAG_STEP_S = 1.0 / 60.0
_LIFT_M = 0.3
_PROBE_RADIUS_M = 0.12

Obstacle = Callable[[Vector3, Vector3], float | None]
"""How far from a start towards an end the scenery is, metres; None where there is none."""


class AttachmentType(IntEnum):
    """``carla.AttachmentType``."""

    RIGID = 0
    SPRING_ARM = 1
    SPRING_ARM_GHOST = 2


@dataclass(frozen=True, slots=True)
class Attachment:
    """How an actor is attached to its parent.

    Attributes:
        kind: rigidly or by an arm.
        socket: bone or socket of the parent that carries it, empty for the parent's origin.
    """

    kind: AttachmentType = AttachmentType.RIGID
    socket: str = ""


RIGID = Attachment()


@dataclass(slots=True)
class SpringArm:
    """One arm and what it remembers from tick to tick.

    Args:
        end: where the script put the child, in the parent's frame, metres.
        ghost: whether it goes through scenery, and is not lifted against bumps.

    Attributes:
        yaw_deg: heading of the arm in the world, None before the first tick.
    """

    end: Vector3
    ghost: bool
    yaw_deg: float | None = None
    _length_m: float = field(init=False)
    _parent_from_arm: FloatArray = field(init=False)
    _pitch_deg: float = field(init=False)

    def __post_init__(self) -> None:
        x, y, z = (-component for component in self.end)
        self._length_m = math.sqrt(x * x + y * y + z * z)
        self._pitch_deg = math.degrees(math.atan2(z, math.hypot(x, y)))
        yaw_deg = math.degrees(math.atan2(y, x))
        self._parent_from_arm = rotation_matrix((self._pitch_deg, yaw_deg, 0.0))

    def follow(
        self, world_from_parent: FloatArray, delta_s: float, obstacle: Obstacle | None
    ) -> FloatArray:
        """Turn after the parent.

        Args:
            world_from_parent: ``(4, 4)`` pose of the parent.
            delta_s: seconds since the last tick.
            obstacle: finds scenery between the parent and the arm's end.

        Returns:
            ``(4, 4)`` pose of the arm's end in the world.
        """
        heading = rotation_deg(world_from_parent[:3, :3] @ self._parent_from_arm)
        self.yaw_deg = self._lagged(float(heading[1]), delta_s)
        # The parent's pitch and roll are not inherited: the arm keeps its own.
        rotation = (self._pitch_deg, self.yaw_deg, 0.0)
        origin = world_from_parent[:3, 3] + (0.0, 0.0, 0.0 if self.ghost else _LIFT_M)
        ahead = rotation_matrix(rotation)[:, 0]
        end = origin - ahead * self._length_m
        if not self.ghost and obstacle is not None and self._length_m > 0.0:
            distance_m = obstacle(_vector(origin), _vector(end))
            if distance_m is not None:
                end = origin - ahead * max(distance_m - _PROBE_RADIUS_M, 0.0)
        matrix: FloatArray = pose_matrix(end, rotation)
        return matrix

    def _lagged(self, target_deg: float, delta_s: float) -> float:
        """UE's lag: steps of at most 1/60 s towards a target that moves evenly through the tick."""
        if self.yaw_deg is None:
            return target_deg
        yaw_deg, left_s = self.yaw_deg, delta_s
        turn_deg = (target_deg - yaw_deg + 180.0) % 360.0 - 180.0
        goal_deg = yaw_deg
        while left_s > 1e-4:
            step_s = min(_LONGEST_LAG_STEP_S, left_s)
            goal_deg += turn_deg * step_s / delta_s
            yaw_deg += (goal_deg - yaw_deg) * min(_LAG_PER_S * step_s, 1.0)
            left_s -= step_s
        return (yaw_deg + 180.0) % 360.0 - 180.0


def arm_for(attachment: Attachment, relative: Pose) -> tuple[SpringArm | None, Pose]:
    """The arm of an attachment, and the child's pose: in the arm's end, or in the parent."""
    if attachment.kind is AttachmentType.RIGID:
        return None, relative
    ghost = attachment.kind is AttachmentType.SPRING_ARM_GHOST
    return SpringArm(relative.location, ghost), Pose(rotation_deg=relative.rotation_deg)


def _vector(values: FloatArray) -> Vector3:
    x, y, z = np.asarray(values).tolist()
    return (x, y, z)
