"""Vehicles: control, physics, lights, doors, telemetry."""

from __future__ import annotations

from typing import Any

from carstage_sim.wire import values
from carstage_sim.wire.handlers.registry import Call, handles, handles_void
from carstage_sim.wire.physics import decode_physics, encode_physics, encode_telemetry
from carstage_sim.world.actors import Actor
from carstage_sim.world.controls import AckermannSettings
from carstage_sim.world.errors import WorldError
from carstage_sim.world.state import ActorKind


def _vehicle(call: Call, actor_id: int) -> Actor:
    """A vehicle, live or destroyed a while ago.

    Raises:
        WorldError: it is no vehicle.
    """
    actor = call.world.live_or_dead(actor_id)
    if actor.kind is not ActorKind.VEHICLE or actor.vehicle is None:
        raise WorldError(f"actor {actor_id} is not a vehicle")
    return actor


@handles_void("apply_control_to_vehicle")
def _apply_control_to_vehicle(call: Call, actor_id: int, control: list[Any]) -> None:
    call.world.control_vehicle(actor_id, values.vehicle_control(control))


@handles_void("apply_ackermann_control_to_vehicle")
def _apply_ackermann_control_to_vehicle(call: Call, actor_id: int, control: list[Any]) -> None:
    call.world.control_ackermann(actor_id, values.ackermann_control(control))


@handles("get_ackermann_controller_settings")
def _get_ackermann_controller_settings(call: Call, actor_id: int) -> list[float]:
    status = _vehicle(call, actor_id).vehicle
    gains = status.ackermann_settings if status is not None else AckermannSettings()
    return [
        gains.speed_kp,
        gains.speed_ki,
        gains.speed_kd,
        gains.accel_kp,
        gains.accel_ki,
        gains.accel_kd,
    ]


@handles_void("apply_ackermann_controller_settings")
def _apply_ackermann_controller_settings(call: Call, actor_id: int, gains: list[float]) -> None:
    call.world.set_ackermann_settings(actor_id, AckermannSettings(*values.finite(*gains)))


@handles("get_physics_control")
def _get_physics_control(call: Call, actor_id: int) -> list[Any]:
    vehicle = _vehicle(call, actor_id)
    return encode_physics(call.world.parameters(vehicle), call.world.last_pose(vehicle))


def apply_physics(call: Call, actor_id: int, control: list[Any]) -> None:
    """Replace a live vehicle's parameters by a ``VehiclePhysicsControl``."""
    vehicle = _vehicle(call, actor_id)
    if actor_id in call.world.actors:
        parameters = decode_physics(control, call.world.parameters(vehicle))
        call.world.set_parameters(actor_id, parameters)


@handles_void("apply_physics_control")
def _apply_physics_control(call: Call, actor_id: int, control: list[Any]) -> None:
    apply_physics(call, actor_id, control)


@handles("get_telemetry_data")
def _get_telemetry_data(call: Call, actor_id: int) -> list[Any]:
    vehicle = _vehicle(call, actor_id)
    return encode_telemetry(call.world.parameters(vehicle), call.world.motion(vehicle))


@handles("get_vehicle_light_state")
def _get_vehicle_light_state(call: Call, actor_id: int) -> list[int]:
    status = _vehicle(call, actor_id).vehicle
    return [status.light_state if status is not None else 0]


@handles_void("set_vehicle_light_state")
def _set_vehicle_light_state(call: Call, actor_id: int, flags: list[int]) -> None:
    status = _vehicle(call, actor_id).vehicle
    if status is not None:
        status.light_state = values.light_flags(flags[0])


@handles("get_vehicle_light_states")
def _get_vehicle_light_states(call: Call) -> list[list[int]]:
    return [
        [actor.actor_id, actor.vehicle.light_state]
        for actor in call.world.actors.of_kind(ActorKind.VEHICLE)
        if actor.vehicle is not None
    ]


@handles("get_wheel_steer_angle")
def _get_wheel_steer_angle(call: Call, actor_id: int, wheel: int) -> float:
    vehicle = _vehicle(call, actor_id)
    wheels = call.world.parameters(vehicle).wheels
    steers = wheel < len(wheels) and wheels[wheel].max_steer_angle_deg > 0.0
    return call.world.motion(vehicle).wheel_angle_deg if steers else 0.0


@handles("get_wheel_pitch_angle")
def _get_wheel_pitch_angle(call: Call, actor_id: int, _wheel: int) -> float:
    _vehicle(call, actor_id)
    return 0.0


@handles_void(
    "set_wheel_steer_direction",
    "set_wheel_pitch_angle",
    "open_vehicle_door",
    "close_vehicle_door",
    "show_vehicle_debug_telemetry",
    "set_actor_autopilot",
    "enable_carsim",
    "use_carsim_road",
    "enable_chrono_physics",
    "restore_physx_physics",
)
def _without_effect(call: Call, actor_id: int, *_arguments: Any) -> None:
    """Looks of wheels and doors, and other physics engines: accepted, nothing changes."""
    _vehicle(call, actor_id)
