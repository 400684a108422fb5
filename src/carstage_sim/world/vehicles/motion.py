"""One physics step of a fleet in the plane of the road."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import brief_kernel, device
from carstage_sim.world.columns import Rotation
from carstage_sim.world.vehicles import dynamics as dynamics
from carstage_sim.world.vehicles import powertrain
from carstage_sim.world.vehicles.rows import VehicleRows

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_YAW = int(Rotation.YAW)
_INSTANT_S = 1e-9


class TickConstants(NamedTuple):
    """What stays the same over the physics steps of a tick; ``(N,)`` each.

    Attributes:
        lands_in_s: when wheels begin to work, infinite where they do not within the tick.
        throttle, brake: what the pedals are pressed to, 0 to 1.
        hand_brake: its deceleration, m/s².
        hold: the most that all tyres together can slow down by, m/s².
    """

    lands_in_s: FloatArray
    held: BoolArray
    throttle: FloatArray
    brake: FloatArray
    wheel_target_deg: FloatArray
    slope_and_forces: FloatArray
    sideways_force: FloatArray
    spin_force: FloatArray
    hand_brake: FloatArray
    hold: FloatArray
    traction: FloatArray
    lateral_limit: FloatArray
    wheelbase: FloatArray
    along_ground: FloatArray
    shifts_itself: BoolArray


def tick_constants(rows: VehicleRows, lands_in_s: FloatArray) -> TickConstants:
    """Reads pedals, forces and the slope for the physics steps to come.

    Args:
        lands_in_s: ``(N,)`` seconds until vehicles stand on the ground, 0 for those that do.
    """
    # Columns of their own: a kernel would be compiled once more for those of a table.
    throttle, steer, brake = (rows.control[:, k].astype(np.float64) for k in range(3))
    pitch, yaw, _ = np.radians(rows.rotation_deg).T
    along = rows.force[:, 0] * np.cos(yaw) + rows.force[:, 1] * np.sin(yaw)
    aside = rows.force[:, 1] * np.cos(yaw) - rows.force[:, 0] * np.sin(yaw)
    slope = np.where(rows.airborne | ~rows.gravity, 0.0, -dynamics.GRAVITY * np.sin(pitch))
    hold = rows.max_deceleration * rows.grip
    hand_brake = np.minimum(rows.hand_brake_deceleration, dynamics.HAND_BRAKE_SHARE * hold)
    return TickConstants(
        lands_in_s=np.where(rows.simulated, lands_in_s, np.inf),
        held=~np.isnan(rows.constant_velocity[:, 0]),
        throttle=throttle,
        brake=brake,
        wheel_target_deg=steer * rows.max_steer_deg,
        slope_and_forces=slope + along * rows.inverse_mass,
        sideways_force=aside * rows.inverse_mass,
        spin_force=rows.torque_up * rows.inverse_inertia,
        hand_brake=np.where(rows.hand_brake, hand_brake, 0.0),
        hold=hold,
        traction=dynamics.TRACTION_SHARE * hold,
        lateral_limit=np.minimum(
            rows.max_lateral_acceleration * rows.grip, rows.rollover_acceleration
        ),
        wheelbase=rows.front_axle_x - rows.rear_axle_x,
        along_ground=np.cos(pitch),
        shifts_itself=rows.auto_box & ~rows.manual,
    )


def substep(rows: VehicleRows, tick: TickConstants, elapsed_s: float, dt_s: float) -> float:
    """Moves every simulated vehicle in the plane by ``dt_s`` seconds, in place.

    Args:
        elapsed_s: seconds of the tick that are over.

    Returns:
        The highest speed of all, m/s, slides added.
    """
    columns = _Columns(*(getattr(rows, name) for name in _Columns._fields))
    return float(_move(columns, tick, elapsed_s, dt_s))


class _Columns(NamedTuple):
    """The columns of :class:`VehicleRows` that a physics step reads and writes."""

    location: FloatArray
    rotation_deg: FloatArray
    simulated: BoolArray
    constant_velocity: FloatArray
    speed: FloatArray
    slide: FloatArray
    spin: FloatArray
    turn_rate: FloatArray
    wheel_angle_deg: FloatArray
    throttle: FloatArray
    brake: FloatArray
    gear: NDArray[np.int64]
    shift_left_s: FloatArray
    grip: FloatArray
    rear_axle_x: FloatArray
    max_steer_deg: FloatArray
    brake_deceleration: FloatArray
    steering_curve: FloatArray
    understeer: FloatArray
    power_per_mass: FloatArray
    engine_brake: FloatArray
    max_lateral_acceleration: FloatArray
    max_reverse_speed: FloatArray
    drag_per_mass: FloatArray
    torque: FloatArray
    max_rpm: FloatArray
    rpm_per_speed: FloatArray
    force_per_torque: FloatArray
    shift_up_speed: FloatArray
    shift_down_speed: FloatArray
    shift_time: FloatArray


@brief_kernel
def _move(rows, tick, elapsed_s, dt_s):  # type: ignore[no-untyped-def]
    """:func:`substep` on the columns."""
    fastest = 0.0
    for i in range(rows.speed.shape[0]):
        rolling = tick.lands_in_s[i] <= elapsed_s + _INSTANT_S
        _shift(rows, tick, i, dt_s)
        if rows.simulated[i]:
            _move_one(rows, tick, i, rolling, dt_s)
        else:
            rows.turn_rate[i] = 0.0
        fastest = max(fastest, abs(rows.speed[i]) + abs(rows.slide[i]))
    return fastest


@device
def _move_one(rows, tick, i, rolling, dt_s):  # type: ignore[no-untyped-def]
    before = rows.speed[i]
    speed = _next_speed(rows, tick, i, rolling, dt_s)
    slide = rows.slide[i] + tick.sideways_force[i] * dt_s
    spin = rows.spin[i] + tick.spin_force[i] * dt_s
    wheelbase = tick.wheelbase[i]
    if rolling:
        holds = rows.max_lateral_acceleration[i] * rows.grip[i]
        slide = dynamics.slowed(slide, holds, dt_s)
        spin = dynamics.slowed(spin, dynamics.spin_friction(holds, wheelbase), dt_s)
    held = tick.held[i]
    if held:
        before = speed = rows.constant_velocity[i, 0]
        slide = rows.constant_velocity[i, 1]

    target_deg = dynamics.steering_share(rows.steering_curve, i, speed) * tick.wheel_target_deg[i]
    angle_deg = dynamics.next_steer_angle(
        rows.wheel_angle_deg[i], target_deg, rows.max_steer_deg[i], dt_s
    )
    rate = 0.0
    if rolling:
        limit = tick.lateral_limit[i]
        steered = dynamics.yaw_rate(speed, angle_deg, wheelbase, limit, rows.understeer[i])
        rate = dynamics.next_yaw_rate(rows.turn_rate[i], steered, before, speed, dt_s)

    yaw = math.radians(rows.rotation_deg[i, _YAW])
    turn = rate + spin
    cosine, sine = math.cos(yaw), math.sin(yaw)
    rolled = 0.5 * (before + speed) * tick.along_ground[i]
    x, y = dynamics.arc_displacement(rolled, yaw, turn, dt_s)
    x -= slide * dt_s * sine
    y += slide * dt_s * cosine
    if not held:
        # What no wheel steers does not carry the velocity round with it.
        speed, slide = _turned_back(speed, slide, spin * dt_s)
    yaw += turn * dt_s
    x += rows.rear_axle_x[i] * (cosine - math.cos(yaw))
    y += rows.rear_axle_x[i] * (sine - math.sin(yaw))

    rows.location[i, 0] += x
    rows.location[i, 1] += y
    if turn != 0.0:
        rows.rotation_deg[i, _YAW] = (math.degrees(yaw) + 180.0) % 360.0 - 180.0
    rows.speed[i], rows.slide[i], rows.spin[i] = speed, slide, spin
    rows.turn_rate[i] = rate
    rows.wheel_angle_deg[i] = angle_deg


@device
def _shift(rows, tick, i, dt_s):  # type: ignore[no-untyped-def]
    """Lets an automatic box shift that is in a forward gear and not in the middle of a shift."""
    rows.shift_left_s[i] = max(rows.shift_left_s[i] - dt_s, 0.0)
    gear = rows.gear[i]
    if tick.shifts_itself[i] and gear > 0 and rows.shift_left_s[i] == 0.0:
        rows.gear[i] = powertrain.shifted(
            i, gear, rows.speed[i], rows.shift_up_speed, rows.shift_down_speed
        )
        if rows.gear[i] != gear:
            rows.shift_left_s[i] = rows.shift_time[i]


@device
def _next_speed(rows, tick, i, rolling, dt_s):  # type: ignore[no-untyped-def]
    """Speed after the engine, the brakes and the slope have worked."""
    speed, gear = rows.speed[i], rows.gear[i]
    magnitude = abs(speed)
    throttle = rows.throttle[i] = dynamics.next_pedal(rows.throttle[i], tick.throttle[i], dt_s)
    brake = rows.brake[i] = dynamics.next_pedal(rows.brake[i], tick.brake[i], dt_s)
    if not rolling:
        drag = rows.drag_per_mass[i] * speed * speed
        return dynamics.slowed(speed + tick.slope_and_forces[i] * dt_s, drag, dt_s)
    drive = throttle * powertrain.drive_acceleration(
        i, speed, gear, rows.torque, rows.max_rpm, rows.rpm_per_speed, rows.force_per_torque
    )
    drive = min(drive, rows.power_per_mass[i] / max(magnitude, 0.1), tick.traction[i])
    if gear < 0:
        drive = -drive
    too_fast_backwards = gear < 0 and speed <= -rows.max_reverse_speed[i]
    if rows.shift_left_s[i] > 0.0 or too_fast_backwards:
        drive = 0.0
    braking = brake * rows.brake_deceleration[i] + tick.hand_brake[i]
    holding = min(braking, tick.hold[i]) + min(dynamics.ROLLING_RESISTANCE, tick.hold[i])
    if throttle < 0.01 and gear != 0:
        braking = dynamics.ENGINE_BRAKING + dynamics.ENGINE_BRAKING_PER_SPEED * magnitude
        holding += min(braking * rows.engine_brake[i], tick.traction[i])
    push = drive + tick.slope_and_forces[i]
    return dynamics.next_speed(speed, push, holding, rows.drag_per_mass[i], dt_s)


@device
def _turned_back(speed, slide, angle_rad):  # type: ignore[no-untyped-def]
    """A velocity that stays in the world, in axes that turned by an angle."""
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    return speed * cosine + slide * sine, slide * cosine - speed * sine
