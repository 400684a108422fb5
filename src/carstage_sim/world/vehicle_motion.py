"""One physics step of a fleet in the plane of the road."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world import powertrain
from carstage_sim.world import vehicle_dynamics as dynamics
from carstage_sim.world.vehicle_rows import VehicleRows

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_INSTANT_S = 1e-9


@dataclass(frozen=True, slots=True)
class TickConstants:
    """What stays the same over the physics steps of a tick; ``(N,)`` each.

    Attributes:
        lands_in_s: when wheels begin to work, infinite where they do not within the tick.
    """

    lands_in_s: FloatArray
    held: BoolArray
    throttle: FloatArray
    wheel_target_deg: FloatArray
    slope_and_forces: FloatArray
    sideways_force: FloatArray
    spin_force: FloatArray
    holding: FloatArray
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
    throttle, steer, brake = rows.control.astype(np.float64).T
    pitch, yaw, _ = np.radians(rows.rotation_deg).T
    along = rows.force[:, 0] * np.cos(yaw) + rows.force[:, 1] * np.sin(yaw)
    aside = rows.force[:, 1] * np.cos(yaw) - rows.force[:, 0] * np.sin(yaw)
    slope = np.where(rows.airborne | ~rows.gravity, 0.0, -dynamics.GRAVITY * np.sin(pitch))
    braking = np.minimum(brake * rows.brake_deceleration, rows.max_deceleration * rows.grip)
    hand_brake = np.minimum(
        rows.hand_brake_deceleration,
        dynamics.HAND_BRAKE_SHARE * rows.max_deceleration * rows.grip,
    )
    braking = np.minimum(
        braking + np.where(rows.hand_brake, hand_brake, 0.0), rows.max_deceleration * rows.grip
    )
    return TickConstants(
        lands_in_s=np.where(rows.simulated, lands_in_s, np.inf),
        held=~np.isnan(rows.constant_velocity[:, 0]),
        throttle=throttle,
        wheel_target_deg=steer * rows.max_steer_deg,
        slope_and_forces=slope + along * rows.inverse_mass,
        sideways_force=aside * rows.inverse_mass,
        spin_force=rows.torque_up * rows.inverse_inertia,
        holding=braking + dynamics.ROLLING_RESISTANCE,
        traction=dynamics.TRACTION_SHARE * rows.max_deceleration * rows.grip,
        lateral_limit=np.minimum(
            rows.max_lateral_acceleration * rows.grip, rows.rollover_acceleration
        ),
        wheelbase=rows.front_axle_x - rows.rear_axle_x,
        along_ground=np.cos(pitch),
        shifts_itself=rows.auto_box & ~rows.manual,
    )


def substep(rows: VehicleRows, tick: TickConstants, elapsed_s: float, dt_s: float) -> None:
    """Moves every simulated vehicle in the plane by ``dt_s`` seconds, in place.

    Args:
        elapsed_s: seconds of the tick that are over.
    """
    rolling = tick.lands_in_s <= elapsed_s + _INSTANT_S
    before = rows.speed
    speed = _next_speed(rows, tick, rolling, dt_s)
    slide, spin = rows.slide + tick.sideways_force * dt_s, rows.spin + tick.spin_force * dt_s
    sliding = bool(slide.any() or spin.any())
    if sliding:
        tyres = np.where(rolling, dt_s, 0.0)
        slide = dynamics.slowed(slide, rows.max_lateral_acceleration * rows.grip * tyres, 1.0)
        turning = dynamics.spin_friction(rows.max_lateral_acceleration * rows.grip, tick.wheelbase)
        spin = dynamics.slowed(spin, turning * tyres, 1.0)
    if tick.held.any():
        speed = np.where(tick.held, rows.constant_velocity[:, 0], speed)
        before = np.where(tick.held, speed, before)
        slide = np.where(tick.held, rows.constant_velocity[:, 1], slide)
        sliding = True

    share = dynamics.steering_share(rows.steering_curve, speed)
    angle_deg = dynamics.next_steer_angle(rows.wheel_angle_deg, share * tick.wheel_target_deg, dt_s)
    rate = dynamics.yaw_rate(speed, angle_deg, tick.wheelbase, tick.lateral_limit, rows.understeer)
    rate = np.where(rolling, rate, 0.0)

    yaw = np.radians(rows.rotation_deg[:, 1])
    turn = rate + spin
    heading = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    way = dynamics.arc_displacement(0.5 * (before + speed) * tick.along_ground, yaw, turn, dt_s)
    if sliding:
        way[:, 0] -= slide * dt_s * heading[:, 1]
        way[:, 1] += slide * dt_s * heading[:, 0]
        # What no wheel steers does not carry the velocity round with it.
        speed, slide = _turned_back(speed, slide, np.where(tick.held, 0.0, spin * dt_s))
    yaw = yaw + turn * dt_s
    way[:, 0] += rows.rear_axle_x * (heading[:, 0] - np.cos(yaw))
    way[:, 1] += rows.rear_axle_x * (heading[:, 1] - np.sin(yaw))

    moves = rows.simulated
    rows.location[:, :2] += np.where(moves[:, None], way, 0.0)
    yaw_deg = (np.degrees(yaw) + 180.0) % 360.0 - 180.0
    rows.rotation_deg[:, 1] = np.where(moves & (turn != 0.0), yaw_deg, rows.rotation_deg[:, 1])
    rows.speed = np.where(moves, speed, rows.speed)
    rows.slide = np.where(moves, slide, rows.slide)
    rows.spin = np.where(moves, spin, rows.spin)
    rows.turn_rate = rate
    rows.wheel_angle_deg = np.where(moves, angle_deg, rows.wheel_angle_deg)


def _next_speed(
    rows: VehicleRows, tick: TickConstants, rolling: BoolArray, dt_s: float
) -> FloatArray:
    """Speeds after the engine, the brakes and the slope have worked; shifts gears on the way."""
    speed = rows.speed
    magnitude = np.abs(speed)
    rows.shift_left_s = np.maximum(rows.shift_left_s - dt_s, 0.0)
    gear = powertrain.shifted(
        rows.gear,
        speed,
        tick.shifts_itself & (rows.gear > 0) & (rows.shift_left_s == 0.0),
        shift_up_speed=rows.shift_up_speed,
        shift_down_speed=rows.shift_down_speed,
    )
    rows.shift_left_s = np.where(gear != rows.gear, rows.shift_time, rows.shift_left_s)
    rows.gear = gear
    drive = tick.throttle * powertrain.drive_acceleration(
        speed,
        gear,
        torque=rows.torque,
        max_rpm=rows.max_rpm,
        rpm_per_speed=rows.rpm_per_speed,
        force_per_torque=rows.force_per_torque,
    )
    drive = np.minimum(
        np.minimum(drive, rows.power_per_mass / np.maximum(magnitude, 0.1)), tick.traction
    )
    backwards = gear < 0
    idle = (rows.shift_left_s > 0.0) | (backwards & (speed <= -rows.max_reverse_speed))
    drive = np.where(idle, 0.0, np.where(backwards, -drive, drive))
    released = (tick.throttle < 0.01) & (gear != 0)
    engine = (
        dynamics.ENGINE_BRAKING + dynamics.ENGINE_BRAKING_PER_SPEED * magnitude
    ) * rows.engine_brake
    after = dynamics.next_speed(
        speed,
        push=drive + tick.slope_and_forces,
        holding=tick.holding + np.where(released, engine, 0.0),
        drag_per_mass=rows.drag_per_mass,
        dt_s=dt_s,
    )
    in_air = speed + (tick.slope_and_forces - rows.drag_per_mass * speed * magnitude) * dt_s
    return np.where(rolling, after, in_air)


def _turned_back(
    speed: FloatArray, slide: FloatArray, angle_rad: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """A velocity that stays in the world, in axes that turned by an angle."""
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    return speed * cosine + slide * sine, slide * cosine - speed * sine
