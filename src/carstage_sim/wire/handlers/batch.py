"""``apply_batch``: many commands in one call."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from carstage_sim.wire import values
from carstage_sim.wire.errors import CallError
from carstage_sim.wire.handlers.actors import described
from carstage_sim.wire.handlers.registry import Call, Wrapping, handles, refusal
from carstage_sim.wire.handlers.vehicles import apply_physics
from carstage_sim.world.errors import ActorNotFoundError
from carstage_sim.world.state import ActorKind

logger = logging.getLogger(__name__)

_FUTURE_ACTOR = 0

_Command = Callable[..., None]
_COMMANDS: dict[str, _Command] = {}


def _command(name: str) -> Callable[[_Command], _Command]:
    def register(command: _Command) -> _Command:
        _COMMANDS[name] = command
        return command

    return register


@handles("apply_batch", Wrapping.BARE)
def _apply_batch(call: Call, commands: list[Any], do_tick: bool = False) -> list[Any]:
    results = [_respond(call, command) for command in commands]
    if do_tick:
        call.session.request_tick(None)
    return results


def _respond(call: Call, command: list[Any]) -> list[Any]:
    try:
        ((index, body),) = command
        return [[1, _execute(call, index, body)]]
    except Exception as error:  # noqa: BLE001 - the others of the batch are still due their answers
        return [[0, [refusal("apply_batch", error, command)]]]


def _execute(call: Call, index: int, body: list[Any]) -> int:
    names = call.session.dialect.commands
    name = names[index] if index < len(names) else str(index)
    if name == "SpawnActor":
        return _spawn(call, body)
    if name not in _COMMANDS:
        raise CallError(f"command {name} is not supported")
    actor_id = int(body[0])
    _COMMANDS[name](call, *body)
    return actor_id


def _spawn(call: Call, body: list[Any]) -> int:
    # Versions differ in what stands between the parent and the list of commands that follow. The
    # kind of attachment among it is uninitialised memory unless the script named one.
    description, transform, parent, *_attachment, do_after = body
    type_id, attributes = described(call, description)
    actor = call.world.spawn(
        type_id,
        attributes,
        values.pose(transform),
        parent_id=values.optional(parent) or 0,
    )
    for command in do_after:
        ((index, following),) = command
        if following[0] == _FUTURE_ACTOR:
            following = [actor.actor_id, *following[1:]]
        ((succeeded, failure),) = _respond(call, [[index, following]])
        if not succeeded:
            # The client must learn the id of what lives now, so the answer is that of the spawn.
            logger.warning("after spawning actor %d: %s", actor.actor_id, failure[0])
    return actor.actor_id


@_command("DestroyActor")
def _destroy(call: Call, actor_id: int) -> None:
    if not call.world.destroy(actor_id):
        raise ActorNotFoundError(actor_id)


@_command("ApplyVehicleControl")
def _vehicle_control(call: Call, actor_id: int, control: list[Any]) -> None:
    call.world.control_vehicle(actor_id, values.vehicle_control(control))


@_command("ApplyVehicleAckermannControl")
def _ackermann_control(call: Call, actor_id: int, control: list[Any]) -> None:
    call.world.control_ackermann(actor_id, values.ackermann_control(control))


@_command("ApplyWalkerControl")
def _walker_control(call: Call, actor_id: int, control: list[Any]) -> None:
    call.world.control_walker(actor_id, values.walker_control(control))


@_command("ApplyVehiclePhysicsControl")
def _physics_control(call: Call, actor_id: int, control: list[Any]) -> None:
    apply_physics(call, actor_id, control)


@_command("ApplyTransform")
def _transform(call: Call, actor_id: int, transform: list[Any]) -> None:
    call.world.set_pose(actor_id, values.pose(transform))


@_command("ApplyLocation")
def _location(call: Call, actor_id: int, location: list[float]) -> None:
    call.world.set_location(actor_id, values.vector(location))


@_command("ApplyWalkerState")
def _walker_state(call: Call, actor_id: int, transform: list[Any], speed: float) -> None:
    call.world.place_walker(actor_id, values.pose(transform), *values.finite(speed))


@_command("ApplyTargetVelocity")
def _target_velocity(call: Call, actor_id: int, velocity: list[float]) -> None:
    call.world.set_target_velocity(actor_id, values.vector(velocity))


@_command("ApplyTargetAngularVelocity")
def _target_angular_velocity(call: Call, actor_id: int, velocity: list[float]) -> None:
    call.world.set_target_angular_velocity(actor_id, values.vector(velocity))


@_command("ApplyImpulse")
def _impulse(call: Call, actor_id: int, impulse: list[float]) -> None:
    call.world.add_impulse(actor_id, values.vector(impulse))


@_command("ApplyForce")
def _force(call: Call, actor_id: int, force: list[float]) -> None:
    call.world.add_force(actor_id, values.vector(force))


@_command("ApplyAngularImpulse")
@_command("ApplyTorque")
def _torque(call: Call, actor_id: int, _torque: list[float]) -> None:
    call.world.live(actor_id)


@_command("SetSimulatePhysics")
def _simulate_physics(call: Call, actor_id: int, enabled: bool) -> None:
    call.world.set_simulate_physics(actor_id, bool(enabled))


@_command("SetEnableGravity")
def _enable_gravity(call: Call, actor_id: int, enabled: bool) -> None:
    call.world.live(actor_id).gravity = bool(enabled)


@_command("SetAutopilot")
@_command("ShowDebugTelemetry")
def _of_the_client(call: Call, actor_id: int, _enabled: bool) -> None:
    """The client's Traffic Manager drives; telemetry has no window to appear in."""
    call.world.live(actor_id)


@_command("SetVehicleLightState")
def _light_state(call: Call, actor_id: int, flags: int) -> None:
    vehicle = call.world.live(actor_id).vehicle
    if vehicle is not None:
        vehicle.light_state = values.light_flags(flags)


@_command("SetTrafficLightState")
def _traffic_light_state(call: Call, actor_id: int, state: int) -> None:
    if call.world.live(actor_id).kind is ActorKind.TRAFFIC_LIGHT:
        call.world.lights.set_state(call.world.light_index(actor_id), state)
