"""Bones of walkers, and components, bones and sockets of any actor (0.9.16)."""

from __future__ import annotations

from typing import Any

from carstage_sim.geometry import FloatArray, pose_matrix
from carstage_sim.wire import values
from carstage_sim.wire.errors import CallError
from carstage_sim.wire.handlers.registry import Call, handles, handles_void
from carstage_sim.world.actors import Actor
from carstage_sim.world.errors import WorldError
from carstage_sim.world.pose import Pose
from carstage_sim.world.sockets import actor_from_all_bones, bone_names
from carstage_sim.world.state import ActorKind
from carstage_sim.world.walkers.bones import (
    as_pose,
    bone_transforms,
    pose_bones,
    pose_from_animation,
)

_LAMPS = {
    f"{end}-blinker-{side}-1": (along, across)
    for end, along in (("front", 0.92), ("back", -0.92))
    for side, across in (("r", 0.8), ("l", -0.8))
}
"""Lamps of a vehicle (named as in ``PythonAPI/examples/get_component_test.py``), in box extents."""

_COMPONENTS = {
    ActorKind.VEHICLE: ("VehicleMesh", "MovementComp", "VehicleBounds", *_LAMPS),
    ActorKind.WALKER: ("CollisionCylinder", "Arrow", "CharMoveComp", "CharacterMesh0"),
}
"""Components of UE's ``AWheeledVehicle`` and ``ACharacter``, which CARLA's actors are."""

_WITHOUT_PLACE = ("MovementComp", "CharMoveComp")
_ROOT = "DefaultSceneRoot"


def _walker(call: Call, actor_id: int) -> Actor:
    """A walker, live or destroyed a while ago.

    Raises:
        WorldError: it is no walker.
    """
    actor = call.world.live_or_dead(actor_id)
    if actor.kind is not ActorKind.WALKER:
        raise WorldError(f"actor {actor_id} is not a walker")
    return actor


@handles("get_bones_transform")
def _get_bones_transform(call: Call, actor_id: int) -> list[Any]:
    walker = _walker(call, actor_id)
    if actor_id not in call.world.actors:
        return [[]]
    return [
        [
            [bone.name, *map(values.encode_pose, (bone.world, bone.component, bone.relative))]
            for bone in bone_transforms(call.world.actors, walker)
        ]
    ]


@handles_void("set_bones_transform")
def _set_bones_transform(call: Call, actor_id: int, bones: list[Any]) -> None:
    (named,) = bones
    posed = [(str(name), values.pose(transform)) for name, transform in named]
    pose_bones(_walker(call, actor_id), posed, blend=None)


@handles_void("blend_pose")
def _blend_pose(call: Call, actor_id: int, share: float) -> None:
    pose_bones(_walker(call, actor_id), (), blend=values.finite(share)[0])


@handles_void("get_pose_from_animation")
def _get_pose_from_animation(call: Call, actor_id: int) -> None:
    walker = _walker(call, actor_id)
    if actor_id in call.world.actors:
        pose_from_animation(call.world.actors, walker)


def _components(actor: Actor) -> tuple[str, ...]:
    return _COMPONENTS.get(actor.kind, (_ROOT,))


@handles("get_actor_component_names")
def _get_actor_component_names(call: Call, actor_id: int) -> list[str]:
    return list(_components(call.world.live_or_dead(actor_id)))


def _actor_from_component(actor: Actor, component: str) -> Pose:
    """Where a component is in its actor: at its origin, but boxes and figures.

    Raises:
        CallError: the actor has no such component, or one without a place.
    """
    if component not in _components(actor) or component in _WITHOUT_PLACE:
        raise CallError(f"Component not found: Component Name: {component}")
    if component == "VehicleBounds":
        return Pose(actor.box_center)
    if component in _LAMPS:
        along, across = _LAMPS[component]
        (x, y, z), (length, width, _) = actor.box_center, actor.box_extent
        return Pose((x + along * length, y + across * width, z))
    if component == "CharacterMesh0":
        return Pose((0.0, 0.0, -actor.box_extent[2]))
    return Pose()


@handles("get_actor_component_world_transform")
def _get_actor_component_world_transform(call: Call, actor_id: int, component: str) -> list[Any]:
    actor = call.world.live(actor_id)
    placed = _matrix(_actor_from_component(actor, component))
    return values.encode_pose(as_pose(_world_from_actor(call, actor) @ placed))


@handles("get_actor_component_relative_transform")
def _get_actor_component_relative_transform(call: Call, actor_id: int, component: str) -> list[Any]:
    actor = call.world.live_or_dead(actor_id)
    return values.encode_pose(_actor_from_component(actor, component))


@handles("get_actor_bone_names")
@handles("get_actor_socket_names")
def _get_actor_bone_names(call: Call, actor_id: int) -> list[str]:
    """In UE every bone is a socket too, and CARLA's vehicles and walkers have no others."""
    return bone_names(call.world.live_or_dead(actor_id))


@handles("get_actor_bone_world_transforms")
@handles("get_actor_socket_world_transforms")
@handles("get_vehicle_bone_world_transforms")
def _get_actor_bone_world_transforms(call: Call, actor_id: int) -> list[Any]:
    actor = call.world.live(actor_id)
    world_from_actor = _world_from_actor(call, actor)
    return [
        values.encode_pose(as_pose(world_from_actor @ bone))
        for bone in actor_from_all_bones(call.world.actors, actor)
    ]


@handles("get_actor_bone_relative_transforms")
@handles("get_actor_socket_relative_transforms")
def _get_actor_bone_relative_transforms(call: Call, actor_id: int) -> list[Any]:
    """In the actor's frame: in CARLA these too are relative to the mesh, not to parent bones."""
    actor = call.world.live(actor_id)
    return [
        values.encode_pose(as_pose(bone)) for bone in actor_from_all_bones(call.world.actors, actor)
    ]


def _matrix(pose: Pose) -> FloatArray:
    return pose_matrix(pose.location, pose.rotation_deg)


def _world_from_actor(call: Call, actor: Actor) -> FloatArray:
    return _matrix(call.world.actors.pose(actor.actor_id))
