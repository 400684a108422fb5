"""Where a walker's bones are: its walk, a client's pose, or something in between."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from carstage_sim.content.pedestrians import walking_joints
from carstage_sim.content.posing import Pose as Joints
from carstage_sim.content.skeleton import (
    BONES,
    Transforms,
    component_from_bones,
    component_transforms,
    joints_of,
    relative_transforms,
)
from carstage_sim.content.wheelchairs import seated_joints
from carstage_sim.geometry import FloatArray, pose_matrix, rotation_deg
from carstage_sim.world.actors import Actor, ActorTable
from carstage_sim.world.columns import Rotation
from carstage_sim.world.pose import Pose
from carstage_sim.world.walkers.bone_pose import BonePose
from carstage_sim.world.walkers.gait import roll_phase, walk_phase

_KNOWN = frozenset(bone.name for bone in BONES)


@dataclass(frozen=True, slots=True)
class BoneTransform:
    """One bone, as ``carla.Walker.get_bones`` tells it.

    Attributes:
        world: in the world.
        component: relative to the figure, whose origin is between its feet.
        relative: in the frame of the bone that carries it.
    """

    name: str
    world: Pose
    component: Pose
    relative: Pose


def pose_bones(walker: Actor, posed: Iterable[tuple[str, Pose]], *, blend: float | None) -> None:
    """Give bones poses in their parents' frames; names that no bone has are passed over.

    Args:
        walker: whose bones.
        posed: names and poses; bones that are not named keep what they have.
        blend: share of the pose that is shown, None for the one it has.
    """
    pose = walker.bones if walker.bones is not None else BonePose()
    walker.bones = pose
    pose.relative.update((name, given) for name, given in posed if name in _KNOWN)
    if blend is not None:
        pose.blend = min(max(blend, 0.0), 1.0)


def pose_from_animation(table: ActorTable, walker: Actor) -> None:
    """Make the walk's present pose the one that clients change."""
    posed = [(name, as_pose(matrix)) for name, matrix in _animated(table, walker).items()]
    pose_bones(walker, posed, blend=None)


def bone_transforms(table: ActorTable, walker: Actor) -> list[BoneTransform]:
    """All bones of a live walker as they are shown."""
    relative = _shown(table, walker)
    component = component_transforms(relative)
    world_from_component = _world_from_component(table, walker)
    return [
        BoneTransform(
            bone.name,
            as_pose(world_from_component @ component[bone.name]),
            as_pose(component[bone.name]),
            as_pose(relative[bone.name]),
        )
        for bone in BONES
    ]


def actor_from_bones(table: ActorTable, walker: Actor) -> list[FloatArray]:
    """``(4, 4)`` poses of all bones in their walker's frame, in the skeleton's order."""
    component = component_transforms(_shown(table, walker))
    return [_actor_from_component(walker) @ component[bone.name] for bone in BONES]


def actor_from_bone(table: ActorTable, walker: Actor, name: str) -> FloatArray | None:
    """``(4, 4)`` pose of a bone in its walker's frame; None where it has no such bone."""
    if name not in _KNOWN:
        return None
    matrix: FloatArray = (
        _actor_from_component(walker) @ component_transforms(_shown(table, walker))[name]
    )
    return matrix


def posed_joints(table: ActorTable, walker: Actor) -> Joints | None:
    """Joints of a walker's figure where a client poses it; None for one that just walks."""
    pose = walker.bones
    if pose is None or pose.blend <= 0.0 or not pose.relative:
        return None
    return joints_of(component_transforms(_shown(table, walker)), walker.box_extent[2])


def _animated(table: ActorTable, walker: Actor) -> Transforms:
    row = table.row(walker.actor_id)
    location, yaw_deg = table.location[row], float(table.rotation_deg[row, Rotation.YAW])
    if walker.uses_wheelchair:
        joints = seated_joints(roll_phase(walker.actor_id, location, yaw_deg))
    else:
        phase = walk_phase(
            walker.actor_id, location, yaw_deg, table.velocity[row], walker.box_extent
        )
        joints = walking_joints(walker.type_id, walker.box_extent, phase)
    return relative_transforms(component_from_bones(joints, walker.box_extent[2]))


def _shown(table: ActorTable, walker: Actor) -> Transforms:
    animated = _animated(table, walker)
    if walker.bones is None or walker.bones.blend <= 0.0:
        return animated
    return _blended(animated, walker.bones.relative, walker.bones.blend)


def _blended(animated: Transforms, posed: Mapping[str, Pose], share: float) -> Transforms:
    found = dict(animated)
    for name, pose in posed.items():
        goal, start = pose_matrix(pose.location, pose.rotation_deg), animated[name]
        matrix = np.eye(4)
        matrix[:3, 3] = start[:3, 3] + share * (goal[:3, 3] - start[:3, 3])
        matrix[:3, :3] = start[:3, :3] @ _part(start[:3, :3].T @ goal[:3, :3], share)
        found[name] = matrix
    return found


def _part(rotation: FloatArray, share: float) -> FloatArray:
    """A share of a rotation about the same axis (Rodrigues' formula)."""
    if share >= 1.0:
        return rotation
    cosine = np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0)
    angle = float(np.arccos(cosine))
    skew = (rotation - rotation.T) / 2.0
    sine = float(np.sin(angle))
    if sine < 1e-9:
        return rotation if share >= 0.5 else np.eye(3)
    axis = skew / sine
    part: FloatArray = (
        np.eye(3) + np.sin(share * angle) * axis + (1.0 - np.cos(share * angle)) * axis @ axis
    )
    return part


def _actor_from_component(walker: Actor) -> FloatArray:
    return pose_matrix((0.0, 0.0, -walker.box_extent[2]), (0.0, 0.0, 0.0))


def _world_from_component(table: ActorTable, walker: Actor) -> FloatArray:
    pose = table.pose(walker.actor_id)
    matrix: FloatArray = pose_matrix(pose.location, pose.rotation_deg) @ _actor_from_component(
        walker
    )
    return matrix


def as_pose(matrix: FloatArray) -> Pose:
    """A ``(4, 4)`` pose as location and angles."""
    x, y, z = matrix[:3, 3].tolist()
    pitch, yaw, roll = rotation_deg(matrix[:3, :3]).tolist()
    return Pose((x, y, z), (pitch, yaw, roll))
