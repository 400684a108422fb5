"""Vehicles: control, physics, lights, doors, telemetry."""

from __future__ import annotations

from typing import Any

from carstage_sim.wire import values
from carstage_sim.wire.errors import CallError
from carstage_sim.wire.handlers.registry import Call, handles, handles_void
from carstage_sim.wire.physics import decode_physics, encode_physics, encode_telemetry
from carstage_sim.world.actors import Actor, VehicleStatus
from carstage_sim.world.controls import AckermannSettings
from carstage_sim.world.errors import ActorTypeError
from carstage_sim.world.state import ActorKind

_ALL_DOORS = 6
"""``carla.VehicleDoor.All``; the numbers below it are one door each, hood and trunk among them."""


def _vehicle(call: Call, actor_id: int) -> Actor:
    """A vehicle, live or destroyed a while ago.

    Raises:
        ActorNotFoundError: no such actor.
        ActorTypeError: it is no vehicle.
    """
    actor = call.world.live_or_dead(actor_id)
    if actor.kind is not ActorKind.VEHICLE:
        raise ActorTypeError(actor_id)
    return actor


def vehicle_status(call: Call, actor_id: int) -> VehicleStatus:
    """What clients commanded a vehicle, live or destroyed a while ago.

    Raises:
        ActorNotFoundError: no such actor.
        ActorTypeError: it is no vehicle.
    """
    status = _vehicle(call, actor_id).vehicle
    if status is None:
        raise ActorTypeError(actor_id)
    return status


@handles_void("apply_control_to_vehicle")
def _apply_control_to_vehicle(call: Call, actor_id: int, control: list[Any]) -> None:
    _vehicle(call, actor_id)
    call.world.control_vehicle(actor_id, values.vehicle_control(control))


@handles_void("apply_ackermann_control_to_vehicle")
def _apply_ackermann_control_to_vehicle(call: Call, actor_id: int, control: list[Any]) -> None:
    _vehicle(call, actor_id)
    call.world.control_ackermann(actor_id, values.ackermann_control(control))


@handles("get_ackermann_controller_settings")
def _get_ackermann_controller_settings(call: Call, actor_id: int) -> list[float]:
    gains = vehicle_status(call, actor_id).ackermann_settings
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
    return encode_physics(call.world.parameters_in_effect(vehicle), call.world.last_pose(vehicle))


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
    return [vehicle_status(call, actor_id).light_state]


@handles_void("set_vehicle_light_state")
def _set_vehicle_light_state(call: Call, actor_id: int, flags: list[int]) -> None:
    vehicle_status(call, actor_id).light_state = values.light_flags(flags[0])


@handles("get_vehicle_light_states")
def _get_vehicle_light_states(call: Call) -> list[list[int]]:
    return [
        [actor.actor_id, actor.vehicle.light_state]
        for actor in call.world.actors.of_kind(ActorKind.VEHICLE)
        if actor.vehicle is not None
    ]


@handles_void("open_vehicle_door")
def _open_vehicle_door(call: Call, actor_id: int, door: int) -> None:
    _move_doors(call, actor_id, door, opened=True)


@handles_void("close_vehicle_door")
def _close_vehicle_door(call: Call, actor_id: int, door: int) -> None:
    _move_doors(call, actor_id, door, opened=False)


def _move_doors(call: Call, actor_id: int, door: int, *, opened: bool) -> None:
    """Doors move on vehicles whose blueprint says that they do; on others nothing happens."""
    status = vehicle_status(call, actor_id)
    if _vehicle(call, actor_id).attributes.get("has_dynamic_doors") != "true":
        return
    if not 0 <= door <= _ALL_DOORS:
        raise CallError(f"no door has the number {door}")
    bits = (1 << _ALL_DOORS) - 1 if door == _ALL_DOORS else 1 << door
    status.open_doors = status.open_doors | bits if opened else status.open_doors & ~bits


@handles("get_wheel_steer_angle")
def _get_wheel_steer_angle(call: Call, actor_id: int, wheel: int) -> float:
    vehicle = _vehicle(call, actor_id)
    posed = vehicle_status(call, actor_id).posed_wheels_deg
    if not vehicle.simulate_physics and wheel in posed:
        return posed[wheel]
    wheels = call.world.parameters(vehicle).wheels
    steers = wheel < len(wheels) and wheels[wheel].max_steer_angle_deg > 0.0
    return call.world.motion(vehicle).wheel_angle_deg if steers else 0.0


@handles_void("set_wheel_steer_direction")
def _set_wheel_steer_direction(call: Call, actor_id: int, wheel: int, angle_deg: float) -> None:
    """Poses a wheel of a vehicle without physics; with physics, CARLA refuses too."""
    _pose_wheel(call, actor_id, wheel, angle_deg, vehicle_status(call, actor_id).posed_wheels_deg)


@handles("get_wheel_pitch_angle")
def _get_wheel_pitch_angle(call: Call, actor_id: int, wheel: int) -> float:
    posed = vehicle_status(call, actor_id).posed_wheel_pitch_deg
    return 0.0 if _vehicle(call, actor_id).simulate_physics else posed.get(wheel, 0.0)


@handles_void("set_wheel_pitch_angle")
def _set_wheel_pitch_angle(call: Call, actor_id: int, wheel: int, angle_deg: float) -> None:
    status = vehicle_status(call, actor_id)
    _pose_wheel(call, actor_id, wheel, angle_deg, status.posed_wheel_pitch_deg)


def _pose_wheel(
    call: Call, actor_id: int, wheel: int, angle_deg: float, posed: dict[int, float]
) -> None:
    if _vehicle(call, actor_id).simulate_physics:
        raise CallError("Cannot set wheel steer direction. Physics are enabled.")
    (posed[wheel],) = values.finite(angle_deg)


@handles_void("enable_carsim", "use_carsim_road")
def _carsim(call: Call, actor_id: int, *_arguments: Any) -> None:
    """As a CARLA server that was built without CarSim."""
    _vehicle(call, actor_id)
    raise CallError("CarSim plugin is not enabled")


@handles_void(
    "show_vehicle_debug_telemetry",
    "set_actor_autopilot",
    "enable_chrono_physics",
    "restore_physx_physics",
)
def _without_effect(call: Call, actor_id: int, *_arguments: Any) -> None:
    """Windows and other physics engines, and CARLA's own old autopilot: nothing changes."""
    _vehicle(call, actor_id)
