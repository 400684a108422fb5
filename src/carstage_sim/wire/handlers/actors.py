"""Definitions, spawning and destroying, and what holds for every actor."""

from __future__ import annotations

from typing import Any

from carstage_sim.wire import values
from carstage_sim.wire.errors import CallError
from carstage_sim.wire.handlers.registry import Call, handles, handles_void
from carstage_sim.wire.rpc import Packed
from carstage_sim.world.actors import Actor
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.errors import ActorNotFoundError, SpawnError
from carstage_sim.world.spring_arm import RIGID, Attachment, AttachmentType


def encode_actor(call: Call, actor: Actor) -> list[Any]:
    """An actor as this call's client wants it."""
    return values.encode_actor(actor, call.session.dialect, call.session.streaming_port)


def described(call: Call, description: list[Any]) -> tuple[str, dict[str, str]]:
    """Type id and attribute values of what a client wants to spawn.

    Raises:
        CallError: no blueprint of this version; a sensor's messages would have no number.
    """
    type_id, attributes = values.description(description)
    version = call.session.dialect
    if not version.offers(type_id):
        raise CallError(f"CARLA {version.version} has no blueprint {type_id!r}")
    return type_id, attributes


@handles("get_actor_definitions")
def _get_actor_definitions(call: Call) -> Packed:
    dialect = call.session.dialect
    return call.packed(
        dialect,
        lambda: [
            values.encode_definition(blueprint, dialect)
            for blueprint in catalogue().values()
            if dialect.offers(blueprint.id)
        ],
    )


@handles("get_spectator")
def _get_spectator(call: Call) -> list[Any]:
    return encode_actor(call, call.world.spectator)


@handles("get_actors_by_id")
def _get_actors_by_id(call: Call, actor_ids: list[int]) -> list[Any]:
    actors = (call.world.actors.get(actor_id) for actor_id in actor_ids)
    return [encode_actor(call, actor) for actor in actors if actor is not None]


def spawn(
    call: Call,
    description: list[Any],
    transform: list[Any],
    parent_id: int | None = None,
    attachment: Attachment = RIGID,
) -> Actor:
    """Bring what a client describes into the world, as that client's.

    Raises:
        CallError: see :func:`described`.
        SpawnError: see ``World.spawn``; the parent's id is 0, as a batch has it for an actor that
            it spawns itself.
    """
    type_id, attributes = described(call, description)
    if parent_id == 0:
        raise SpawnError("unable to attach actor: parent actor 0 not found")
    actor = call.world.spawn(
        type_id,
        attributes,
        values.pose(transform),
        parent_id=parent_id or 0,
        attachment=attachment,
    )
    actor.client = call.connection.number
    return actor


@handles("spawn_actor")
def _spawn_actor(call: Call, description: list[Any], transform: list[Any]) -> list[Any]:
    return encode_actor(call, spawn(call, description, transform))


@handles("spawn_actor_with_parent")
def _spawn_actor_with_parent(
    call: Call,
    description: list[Any],
    transform: list[Any],
    parent_id: int,
    attachment: int,
    socket: str = "",
) -> list[Any]:
    if attachment not in set(AttachmentType):
        raise CallError(f"there is no attachment type {attachment}")
    how = Attachment(AttachmentType(attachment), str(socket))
    return encode_actor(call, spawn(call, description, transform, parent_id, how))


def destroy(call: Call, actor_id: int) -> None:
    """Take an actor out of the world.

    Raises:
        CallError: it does not live, or belongs to the map; clients turn this into ``False``.
    """
    if not call.world.destroy(actor_id):
        raise CallError("unable to destroy actor: not found")


@handles("destroy_actor")
def _destroy_actor(call: Call, actor_id: int) -> bool:
    destroy(call, actor_id)
    return True


@handles("get_actor_bounding_box")
def _get_actor_bounding_box(call: Call, actor_id: int) -> list[Any]:
    return values.encode_actor_box(call.world.live_or_dead(actor_id))


@handles_void("set_actor_location")
def _set_actor_location(call: Call, actor_id: int, location: list[float]) -> None:
    call.world.set_location(actor_id, values.vector(location))


@handles_void("set_actor_transform")
def _set_actor_transform(call: Call, actor_id: int, transform: list[Any]) -> None:
    call.world.set_pose(actor_id, values.pose(transform))


@handles_void("set_actor_simulate_physics")
def _set_actor_simulate_physics(call: Call, actor_id: int, enabled: bool) -> None:
    if call.live(actor_id) is not None:
        call.world.set_simulate_physics(actor_id, bool(enabled))


@handles_void("set_actor_enable_gravity")
def _set_actor_enable_gravity(call: Call, actor_id: int, enabled: bool) -> None:
    call.world.set_enable_gravity(actor_id, bool(enabled))


@handles_void("set_actor_collisions")
def _set_actor_collisions(call: Call, actor_id: int, enabled: bool) -> None:
    call.world.set_collides(actor_id, bool(enabled))


@handles_void("set_actor_dead")
def _set_actor_dead(call: Call, actor_id: int) -> None:
    actor = call.live(actor_id)
    if actor is None:
        raise ActorNotFoundError(actor_id)
    call.world.kill_walker(actor_id)


@handles_void("set_actor_target_velocity")
def _set_actor_target_velocity(call: Call, actor_id: int, velocity: list[float]) -> None:
    call.world.set_target_velocity(actor_id, values.vector(velocity))


@handles_void("set_actor_target_angular_velocity")
def _set_actor_target_angular_velocity(call: Call, actor_id: int, velocity: list[float]) -> None:
    call.world.set_target_angular_velocity(actor_id, values.vector(velocity))


@handles_void("enable_actor_constant_velocity")
def _enable_actor_constant_velocity(call: Call, actor_id: int, velocity: list[float]) -> None:
    call.world.set_constant_velocity(actor_id, values.vector(velocity))


@handles_void("disable_actor_constant_velocity")
def _disable_actor_constant_velocity(call: Call, actor_id: int) -> None:
    call.world.set_constant_velocity(actor_id, None)


@handles_void("add_actor_impulse")
def _add_actor_impulse(call: Call, actor_id: int, impulse: list[float]) -> None:
    call.world.add_impulse(actor_id, values.vector(impulse))


@handles_void("add_actor_force")
def _add_actor_force(call: Call, actor_id: int, force: list[float]) -> None:
    call.world.add_force(actor_id, values.vector(force))


@handles_void("add_actor_impulse_at_location")
def _add_actor_impulse_at_location(
    call: Call, actor_id: int, impulse: list[float], location: list[float]
) -> None:
    call.world.add_impulse(actor_id, values.vector(impulse), values.vector(location))


@handles_void("add_actor_force_at_location")
def _add_actor_force_at_location(
    call: Call, actor_id: int, force: list[float], location: list[float]
) -> None:
    call.world.add_force(actor_id, values.vector(force), values.vector(location))


@handles_void("add_actor_angular_impulse")
def _add_actor_angular_impulse(call: Call, actor_id: int, impulse: list[float]) -> None:
    call.world.add_angular_impulse(actor_id, values.vector(impulse))


@handles_void("add_actor_torque")
def _add_actor_torque(call: Call, actor_id: int, torque: list[float]) -> None:
    call.world.add_torque(actor_id, values.vector(torque))
