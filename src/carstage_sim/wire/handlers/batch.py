"""``apply_batch``: many commands in one call."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from typing import Any

from carstage_sim.wire import values
from carstage_sim.wire.argument_types import argument_check
from carstage_sim.wire.errors import CallError
from carstage_sim.wire.handlers.actors import destroy, spawn
from carstage_sim.wire.handlers.registry import (
    Call,
    TickRequest,
    Wrapping,
    handles,
    refusal,
)
from carstage_sim.wire.handlers.vehicles import apply_physics
from carstage_sim.world.actors import VehicleStatus
from carstage_sim.world.errors import ActorTypeError
from carstage_sim.world.spring_arm import Attachment
from carstage_sim.world.state import ActorKind

logger = logging.getLogger(__name__)

_FUTURE_ACTOR = 0

_Command = Callable[..., None]
_COMMANDS: dict[str, _Command] = {}
_CHECKS: dict[str, Callable[[str, Sequence[Any]], None]] = {}
_CALLS = {"SpawnActor": "spawn_actor"}
"""The call that a command stands for; refusals name it, as CARLA's do."""


def _command(name: str, call: str) -> Callable[[_Command], _Command]:
    def register(command: _Command) -> _Command:
        _COMMANDS[name] = command
        _CHECKS[name] = argument_check(command)
        _CALLS[name] = call
        return command

    return register


@handles("apply_batch", Wrapping.BARE)
def _apply_batch(call: Call, commands: list[Any], do_tick: bool = False) -> list[Any]:
    results = [_respond(call, command) for command in commands]
    if do_tick:
        call.session.request_tick(TickRequest(call, time.monotonic(), is_answered=True))
    return results


def _respond(call: Call, command: list[Any]) -> list[Any]:
    name = ""
    try:
        ((index, body),) = command
        names = call.session.dialect.commands
        name = names[index] if index < len(names) else str(index)
        return [[1, _execute(call, name, body)]]
    except Exception as error:  # noqa: BLE001 - the others of the batch are still due their answers
        return [[0, [refusal(_CALLS.get(name, "apply_batch"), error, command)]]]


def _execute(call: Call, name: str, body: list[Any]) -> int:
    if name == "SpawnActor":
        return _spawn(call, body)
    if name not in _COMMANDS:
        raise CallError(f"command {name} is not supported")
    actor_id = int(body[0])
    _CHECKS[name](name, body)
    _COMMANDS[name](call, *body)
    return actor_id


def _spawn(call: Call, body: list[Any]) -> int:
    # Versions differ in what stands between the parent and the list of commands that follow.
    description, transform, parent, *attachment, do_after = body
    parent_id = values.optional(parent)
    actor = spawn(call, description, transform, parent_id, _attachment(*attachment))
    for command in do_after:
        ((index, following),) = command
        if following[0] == _FUTURE_ACTOR:
            following = [actor.actor_id, *following[1:]]
        ((succeeded, failure),) = _respond(call, [[index, following]])
        if not succeeded:
            # The client must learn the id of what lives now, so the answer is that of the spawn.
            logger.warning("after spawning actor %d: %s", actor.actor_id, failure[0])
    return actor.actor_id


def _attachment(_kind: int = 0, socket: str = "") -> Attachment:
    """What a spawn command says of the attachment: always rigid.

    The 0.9.16 client leaves the kind uninitialised in a batch, also where a script names one (seen
    on the wire: 88 and 144), so it cannot be told from chance.
    """
    return Attachment(socket=str(socket))


def _live_vehicle(call: Call, actor_id: int) -> VehicleStatus:
    status = call.world.live(actor_id).vehicle
    if status is None:
        raise ActorTypeError(actor_id)
    return status


@_command("DestroyActor", "destroy_actor")
def _destroy(call: Call, actor_id: int) -> None:
    destroy(call, actor_id)


@_command("ApplyVehicleControl", "apply_control_to_vehicle")
def _vehicle_control(call: Call, actor_id: int, control: list[Any]) -> None:
    _live_vehicle(call, actor_id)
    call.world.control_vehicle(actor_id, values.vehicle_control(control))


@_command("ApplyVehicleAckermannControl", "apply_ackermann_control_to_vehicle")
def _ackermann_control(call: Call, actor_id: int, control: list[Any]) -> None:
    _live_vehicle(call, actor_id)
    call.world.control_ackermann(actor_id, values.ackermann_control(control))


@_command("ApplyWalkerControl", "apply_control_to_walker")
def _walker_control(call: Call, actor_id: int, control: list[Any]) -> None:
    if call.world.live(actor_id).kind is not ActorKind.WALKER:
        raise ActorTypeError(actor_id)
    call.world.control_walker(actor_id, values.walker_control(control))


@_command("ApplyVehiclePhysicsControl", "apply_physics_control")
def _physics_control(call: Call, actor_id: int, control: list[Any]) -> None:
    apply_physics(call, actor_id, control)


@_command("ApplyTransform", "set_actor_transform")
def _transform(call: Call, actor_id: int, transform: list[Any]) -> None:
    call.world.set_pose(actor_id, values.pose(transform))


@_command("ApplyLocation", "set_actor_location")
def _location(call: Call, actor_id: int, location: list[float]) -> None:
    call.world.set_location(actor_id, values.vector(location))


@_command("ApplyWalkerState", "set_walker_state")
def _walker_state(call: Call, actor_id: int, transform: list[Any], speed: float) -> None:
    call.world.place_walker(actor_id, values.pose(transform), *values.finite(speed))


@_command("ApplyTargetVelocity", "set_actor_target_velocity")
def _target_velocity(call: Call, actor_id: int, velocity: list[float]) -> None:
    call.world.set_target_velocity(actor_id, values.vector(velocity))


@_command("ApplyTargetAngularVelocity", "set_actor_target_angular_velocity")
def _target_angular_velocity(call: Call, actor_id: int, velocity: list[float]) -> None:
    call.world.set_target_angular_velocity(actor_id, values.vector(velocity))


@_command("ApplyImpulse", "add_actor_impulse")
def _impulse(call: Call, actor_id: int, impulse: list[float]) -> None:
    call.world.add_impulse(actor_id, values.vector(impulse))


@_command("ApplyForce", "add_actor_force")
def _force(call: Call, actor_id: int, force: list[float]) -> None:
    call.world.add_force(actor_id, values.vector(force))


@_command("ApplyAngularImpulse", "add_actor_angular_impulse")
def _angular_impulse(call: Call, actor_id: int, impulse: list[float]) -> None:
    call.world.add_angular_impulse(actor_id, values.vector(impulse))


@_command("ApplyTorque", "add_actor_torque")
def _torque(call: Call, actor_id: int, torque: list[float]) -> None:
    call.world.add_torque(actor_id, values.vector(torque))


@_command("SetSimulatePhysics", "set_actor_simulate_physics")
def _simulate_physics(call: Call, actor_id: int, enabled: bool) -> None:
    call.world.set_simulate_physics(actor_id, bool(enabled))


@_command("SetEnableGravity", "set_actor_enable_gravity")
def _enable_gravity(call: Call, actor_id: int, enabled: bool) -> None:
    call.world.live(actor_id)
    call.world.set_enable_gravity(actor_id, bool(enabled))


@_command("SetAutopilot", "set_actor_autopilot")
@_command("ShowDebugTelemetry", "show_vehicle_debug_telemetry")
def _of_the_client(call: Call, actor_id: int, _enabled: bool) -> None:
    """The client's Traffic Manager drives; telemetry has no window to appear in."""
    call.world.live(actor_id)


@_command("SetVehicleLightState", "set_vehicle_light_state")
def _light_state(call: Call, actor_id: int, flags: int) -> None:
    _live_vehicle(call, actor_id).light_state = values.light_flags(flags)


@_command("SetTrafficLightState", "set_traffic_light_state")
def _traffic_light_state(call: Call, actor_id: int, state: int) -> None:
    if call.world.live(actor_id).kind is not ActorKind.TRAFFIC_LIGHT:
        raise ActorTypeError(actor_id)
    call.world.lights.set_state(call.world.light_index(actor_id), values.traffic_light_state(state))
