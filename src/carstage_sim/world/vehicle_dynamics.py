"""Equations of motion of a fleet: a kinematic single-track model with bounded tyre forces.

Pure functions on columns of shape ``(N,)``. The model is the kinematic single-track model (KS) of
Althoff, Koschi, Manzinger, "CommonRoad: Composable Benchmarks for Motion Planning on Roads" (2017),
with the reference point on the rear axle, extended by a bound on the lateral acceleration: without
it a wheel that turns 70 degrees would spin the car at any speed. What collisions and impulses add
to the motion that the wheels allow, a slide and a spin, dry friction takes away again.
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
TRACTION_SHARE = 0.65  # of the full brake: only some wheels are driven
FRONTAL_AREA_TIMES_HALF_RHO = 1.3  # kg/m
NORMAL_TIRE_FRICTION = 3.5
"""``tire_friction`` of CARLA's wheels: the one that a blueprint's accelerations belong to."""
WET_GRIP_LOSS = 0.3
"""Share of the grip that is lost on a road under water. CARLA's weather changes no physics; dry
asphalt has a friction of 0.8, wet asphalt one of 0.5 to 0.7 (Wong, "Theory of Ground Vehicles")."""

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


def rollover_acceleration(track_m: float, mass_height_m: float) -> float:
    """Lateral acceleration (m/s^2) that lifts the inner wheels: ``g t / 2h``.

    The static stability factor (NHTSA). Two-wheelers lean instead and have no such bound.
    """
    if track_m <= 0.0 or mass_height_m <= 0.0:
        return float("inf")
    return GRAVITY * track_m / (2.0 * mass_height_m)


def grip(tire_friction: FloatArray, puddles_percent: float) -> FloatArray:
    """Share of the dry road's grip, ``(N,)``: 1 with CARLA's own tyres on a dry road."""
    wet = min(max(puddles_percent / 100.0, 0.0), 1.0)
    share = np.clip(tire_friction / NORMAL_TIRE_FRICTION, 0.0, 1.5)
    return np.asarray(share * (1.0 - WET_GRIP_LOSS * wet))


def next_speed(
    speed: FloatArray,
    *,
    push: FloatArray,
    holding: FloatArray,
    drag_per_mass: FloatArray,
    dt_s: float,
) -> FloatArray:
    """Signed speed along the heading after one substep, ``(N,)`` m/s.

    Brake and resistance can only take speed away: they stop the vehicle and hold it, also on a
    slope, and never turn its motion round.

    Args:
        push: m/s^2 of what accelerates: engine, slope, forces.
        holding: m/s^2, not negative, of what resists any motion: brakes, rolling, engine braking.
        drag_per_mass: 1/m; times speed squared is the drag's deceleration.
    """
    resistance = holding + drag_per_mass * speed * speed
    pushed = speed + push * dt_s
    return np.asarray(np.copysign(np.maximum(np.abs(pushed) - resistance * dt_s, 0.0), pushed))


def next_steer_angle(angle_deg: FloatArray, target_deg: FloatArray, dt_s: float) -> FloatArray:
    """Front wheel angle after one substep: towards the target at a bounded rate, degrees."""
    bound = STEER_RATE_DEG_S * dt_s
    return np.asarray(angle_deg + np.minimum(np.maximum(target_deg - angle_deg, -bound), bound))


def yaw_rate(
    speed: FloatArray,
    steer_deg: FloatArray,
    wheelbase_m: FloatArray,
    max_lateral_acceleration: FloatArray,
    understeer: FloatArray,
) -> FloatArray:
    """Yaw rate in rad/s, positive to the right (left-handed frame), bounded by the tyres' grip.

    Args:
        understeer: ``(N,)`` s^2/m^2; the turn is that of a wheelbase ``1 + understeer * speed^2``
            times as long.
    """
    rate = (
        speed * np.tan(np.radians(steer_deg)) / (wheelbase_m * (1.0 + understeer * speed * speed))
    )
    bound = max_lateral_acceleration / np.maximum(np.abs(speed), 0.1)
    return np.asarray(np.minimum(np.maximum(rate, -bound), bound))


def spin_friction(max_lateral_acceleration: FloatArray, wheelbase_m: FloatArray) -> FloatArray:
    """Angular deceleration (rad/s^2) of a vehicle that spins with all tyres sliding.

    Each axle holds half the weight at half the wheelbase L from the middle, and the radius of
    gyration of a car is about L / 2 too, so it is ``2 a / L``.
    """
    return np.asarray(2.0 * max_lateral_acceleration / wheelbase_m)


def slowed(value: FloatArray, deceleration: FloatArray, dt_s: float) -> FloatArray:
    """A slide or a spin after dry friction has worked on it for a while; it stops at 0."""
    return np.asarray(np.copysign(np.maximum(np.abs(value) - deceleration * dt_s, 0.0), value))


def arc_displacement(
    speed: FloatArray, yaw_rad: FloatArray, rate_rad_s: FloatArray, dt_s: float
) -> FloatArray:
    """``(N, 2)`` metres that the rear axle moves along its circular arc in one substep, exactly."""
    half_turn = 0.5 * rate_rad_s * dt_s
    chord = speed * dt_s * np.sinc(half_turn / np.pi)
    heading = yaw_rad + half_turn
    return np.stack([chord * np.cos(heading), chord * np.sin(heading)], axis=-1)
