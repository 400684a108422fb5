"""Components, bones and sockets of actors (0.9.16): actors here are one rigid piece."""

from __future__ import annotations

from typing import Any

from carstage_sim.wire import values
from carstage_sim.wire.handlers.registry import Call, handles
from carstage_sim.world.pose import Pose


@handles("get_actor_component_names")
def _get_actor_component_names(call: Call, actor_id: int) -> list[str]:
    call.world.live_or_dead(actor_id)
    return []


@handles("get_actor_bone_names")
def _get_actor_bone_names(call: Call, actor_id: int) -> list[str]:
    call.world.live_or_dead(actor_id)
    return []


@handles("get_actor_socket_names")
def _get_actor_socket_names(call: Call, actor_id: int) -> list[str]:
    call.world.live_or_dead(actor_id)
    return []


@handles("get_actor_component_world_transform")
def _get_actor_component_world_transform(call: Call, actor_id: int, _component: str) -> list[Any]:
    actor = call.world.live(actor_id)
    return values.encode_pose(call.world.actors.pose(actor.actor_id))


@handles("get_actor_component_relative_transform")
def _get_actor_component_relative_transform(
    call: Call, actor_id: int, _component: str
) -> list[Any]:
    call.world.live_or_dead(actor_id)
    return values.encode_pose(Pose())


def _no_transforms(call: Call, actor_id: int) -> list[Any]:
    call.world.live_or_dead(actor_id)
    return []


for _name in (
    "get_actor_bone_world_transforms",
    "get_actor_bone_relative_transforms",
    "get_actor_socket_world_transforms",
    "get_actor_socket_relative_transforms",
    "get_vehicle_bone_world_transforms",
):
    handles(_name)(_no_transforms)
