"""Equations of motion of a fleet: a kinematic single-track model with bounded tyre forces.

Pure functions on columns of shape ``(N,)``. The model is the kinematic single-track model (KS) of
Althoff, Koschi, Manzinger, "CommonRoad: Composable Benchmarks for Motion Planning on Roads" (2017),
with the reference point on the rear axle, extended by a bound on the lateral acceleration: without
it a wheel that turns 70 degrees would spin the car at any speed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

GRAVITY = 9.81
STEER_RATE_DEG_S = 180.0
ROLLING_RESISTANCE = 0.12  # m/s^2
ENGINE_BRAKING = 0.15  # m/s^2 with the throttle released
ENGINE_BRAKING_PER_SPEED = 0.015  # 1/s
HAND_BRAKE_SHARE = 0.6  # of the full brake: only the rear wheels are held
FRONTAL_AREA_TIMES_HALF_RHO = 1.3  # kg/m

CURVE_STEP_KMH = 10.0
CURVE_POINTS = 16


def sample_steering_curve(curve: tuple[tuple[float, float], ...]) -> FloatArray:
    """A steering curve on the uniform grid that :func:`steering_share` reads, ``(16,)``."""
    speeds, shares = np.array(curve, dtype=np.float64).T
    grid = np.arange(CURVE_POINTS, dtype=np.float64) * CURVE_STEP_KMH
    return np.asarray(np.interp(grid, speeds, shares), dtype=np.float64)


def steering_share(curves: FloatArray, speed: FloatArray) -> FloatArray:
    """Share of the steering angle at each speed.

    Args:
        curves: ``(N, 16)`` from :func:`sample_steering_curve`.
        speed: ``(N,)`` m/s, of any sign.
    """
    position = np.minimum(np.abs(speed) * 3.6 / CURVE_STEP_KMH, CURVE_POINTS - 1.001)
    low = position.astype(np.intp)
    rows = np.arange(len(speed))
    part = position - low
    return np.asarray(curves[rows, low] * (1.0 - part) + curves[rows, low + 1] * part)


def next_speed(
    speed: FloatArray,
    *,
    throttle: FloatArray,
    brake: FloatArray,
    hand_brake: NDArray[np.bool_],
    direction: FloatArray,
    slope_acceleration: FloatArray,
    max_acceleration: FloatArray,
    power_per_mass: FloatArray,
    max_deceleration: FloatArray,
    max_reverse_speed: FloatArray,
    drag_per_mass: FloatArray,
    dt_s: float,
) -> FloatArray:
    """Signed speed along the heading after one substep, ``(N,)`` m/s.

    Brake and resistance can only take speed away: they stop the vehicle and hold it, also on a
    slope, and never turn its motion round.

    Args:
        throttle, brake: 0 to 1.
        direction: +1 in a forward gear, -1 in reverse.
        slope_acceleration: gravity along the heading, m/s^2.
        drag_per_mass: 1/m; times speed squared is the drag's deceleration.
    """
    magnitude = np.abs(speed)
    drive = throttle * np.minimum(max_acceleration, power_per_mass / np.maximum(magnitude, 0.1))
    too_fast_backwards = (direction < 0.0) & (speed <= -max_reverse_speed)
    drive = np.where(too_fast_backwards, 0.0, drive) * direction
    brakes = brake * max_deceleration + hand_brake * HAND_BRAKE_SHARE * max_deceleration
    resistance = (
        np.minimum(brakes, max_deceleration)
        + ROLLING_RESISTANCE
        + drag_per_mass * magnitude**2
        + (throttle < 0.01) * (ENGINE_BRAKING + ENGINE_BRAKING_PER_SPEED * magnitude)
    )
    pushed = speed + (drive + slope_acceleration) * dt_s
    return np.asarray(np.sign(pushed) * np.maximum(np.abs(pushed) - resistance * dt_s, 0.0))


def next_steer_angle(angle_deg: FloatArray, target_deg: FloatArray, dt_s: float) -> FloatArray:
    """Front wheel angle after one substep: towards the target at a bounded rate, degrees."""
    bound = STEER_RATE_DEG_S * dt_s
    return np.asarray(angle_deg + np.clip(target_deg - angle_deg, -bound, bound))


def yaw_rate(
    speed: FloatArray,
    steer_deg: FloatArray,
    wheelbase_m: FloatArray,
    max_lateral_acceleration: FloatArray,
) -> FloatArray:
    """Yaw rate in rad/s, positive to the right (left-handed frame), bounded by the tyres' grip."""
    rate = speed * np.tan(np.radians(steer_deg)) / wheelbase_m
    bound = max_lateral_acceleration / np.maximum(np.abs(speed), 0.1)
    return np.asarray(np.clip(rate, -bound, bound))


def arc_displacement(
    speed: FloatArray, yaw_rad: FloatArray, rate_rad_s: FloatArray, dt_s: float
) -> FloatArray:
    """``(N, 2)`` metres that the rear axle moves along its circular arc in one substep, exactly."""
    half_turn = 0.5 * rate_rad_s * dt_s
    chord = speed * dt_s * np.sinc(half_turn / np.pi)
    heading = yaw_rad + half_turn
    return np.stack([chord * np.cos(heading), chord * np.sin(heading)], axis=-1)
