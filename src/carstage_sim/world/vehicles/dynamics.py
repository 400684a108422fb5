"""Equations of motion of a fleet: a kinematic single-track model with bounded tyre forces.

Pure functions of one vehicle, which the kernel of a physics step calls. The model is the kinematic
single-track model (KS) of Althoff, Koschi, Manzinger, "CommonRoad: Composable Benchmarks for Motion
Planning on Roads" (2017), with the reference point on the rear axle, extended by a bound on the
lateral acceleration: without it a wheel that turns 70 degrees would spin the car at any speed.
Pedals, steering wheel and tyres follow what is asked of them with a lag. What collisions and
impulses add to the motion that the wheels allow, a slide and a spin, dry friction takes away again.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device

FloatArray = NDArray[np.float64]

GRAVITY = 9.81
PEDAL_PRESSED_PER_S, PEDAL_RELEASED_PER_S = 6.0, 10.0
STEERED_OUT_PER_S, STEERED_BACK_PER_S = 2.5, 5.0
"""How fast pedals and the steering wheel follow a command, in shares of their range per second: the
defaults of Unreal's vehicles, on which CARLA's are built."""
CORNERING_STIFFNESS = 12.0
"""Of an axle, as a multiple of its load, 1/rad: cars have 10 to 15 (Rajamani, "Vehicle Dynamics and
Control", chapter 2)."""
RELAXATION_M = 0.5
"""Way that a tyre rolls until most of its side force is there (Pacejka, "Tire and Vehicle
Dynamics", chapter 1)."""
SLOWEST_TURN_IN_M_S = 1.0
"""The relaxation counts as at this speed for who is slower."""
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


@device
def steering_share(curves, row, speed):  # type: ignore[no-untyped-def]
    """Share of the steering angle at a speed.

    Args:
        curves: ``(N, 16)`` from :func:`sample_steering_curve`.
        row: of the vehicle.
        speed: m/s, of any sign.
    """
    position = min(abs(speed) * 3.6 / CURVE_STEP_KMH, CURVE_POINTS - 1.001)
    low = int(position)
    part = position - low
    return curves[row, low] * (1.0 - part) + curves[row, low + 1] * part


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


@device
def next_speed(speed, push, holding, drag_per_mass, dt_s):  # type: ignore[no-untyped-def]
    """Signed speed along the heading after one substep, m/s.

    Brake and resistance can only take speed away: they stop the vehicle and hold it, also on a
    slope, and never turn its motion round.

    Args:
        push: m/s^2 of what accelerates: engine, slope, forces.
        holding: m/s^2, not negative, of what resists any motion: brakes, rolling, engine braking.
        drag_per_mass: 1/m; times speed squared is the drag's deceleration.
    """
    return slowed(speed + push * dt_s, holding + drag_per_mass * speed * speed, dt_s)


@device
def next_pedal(pressed, target, dt_s):  # type: ignore[no-untyped-def]
    """How far a pedal is pressed after one substep, 0 to 1."""
    pressing, releasing = PEDAL_PRESSED_PER_S * dt_s, PEDAL_RELEASED_PER_S * dt_s
    return pressed + min(max(target - pressed, -releasing), pressing)


@device
def next_steer_angle(angle_deg, target_deg, max_deg, dt_s):  # type: ignore[no-untyped-def]
    """Front wheel angle after one substep, degrees: towards the target at a bounded rate."""
    change = target_deg - angle_deg
    outwards = change * angle_deg >= 0.0
    bound = (STEERED_OUT_PER_S if outwards else STEERED_BACK_PER_S) * max_deg * dt_s
    return angle_deg + min(max(change, -bound), bound)


@device
def next_yaw_rate(rate, target, before, speed, dt_s):  # type: ignore[no-untyped-def]
    """Yaw rate (rad/s) after one substep: the tyres need a moment to turn the car in.

    Who slows down meanwhile stays on the same arc, and at rest nobody turns.

    The linear single-track model of a car whose radius of gyration is half its wheelbase L moves
    like two axles, each with half the mass and its own tyres: the front axle takes on the sideways
    speed that its wheels are steered to with the time constant ``v / (c g)``, c the cornering
    stiffness over the load (Rajamani, chapter 2). Before that, a tyre's force builds up over the
    relaxation length.

    Args:
        rate, target: rad/s as it was, and as :func:`yaw_rate` has it.
        before, speed: m/s at the begin and the end of the substep.
    """
    kept = min(max(speed / before, 0.0), 1.0) if before != 0.0 else 0.0
    moving = max(abs(speed), SLOWEST_TURN_IN_M_S)
    lag_s = moving / (CORNERING_STIFFNESS * GRAVITY) + RELAXATION_M / moving
    return target + (kept * rate - target) * math.exp(-dt_s / lag_s)


@device
def yaw_rate(  # type: ignore[no-untyped-def]
    speed, steer_deg, wheelbase_m, max_lateral_acceleration, understeer
):
    """Yaw rate in rad/s, positive to the right (left-handed frame), bounded by the tyres' grip.

    Args:
        understeer: s^2/m^2; the turn is that of a wheelbase ``1 + understeer * speed^2`` times as
            long.
    """
    long_m = wheelbase_m * (1.0 + understeer * speed * speed)
    bound = max_lateral_acceleration / max(abs(speed), 0.1)
    return min(max(speed * math.tan(math.radians(steer_deg)) / long_m, -bound), bound)


@device
def spin_friction(max_lateral_acceleration, wheelbase_m):  # type: ignore[no-untyped-def]
    """Angular deceleration (rad/s^2) of a vehicle that spins with all tyres sliding.

    Each axle holds half the weight at half the wheelbase L from the middle, and the radius of
    gyration of a car is about L / 2 too, so it is ``2 a / L``.
    """
    return 2.0 * max_lateral_acceleration / wheelbase_m


@device
def slowed(value, deceleration, dt_s):  # type: ignore[no-untyped-def]
    """A speed, slide or spin after friction has worked on it for a while; it stops at 0."""
    return math.copysign(max(abs(value) - deceleration * dt_s, 0.0), value)


@device
def arc_displacement(speed, yaw_rad, rate_rad_s, dt_s):  # type: ignore[no-untyped-def]
    """Metres (x, y) that the rear axle moves along its circular arc in one substep, exactly."""
    half_turn = 0.5 * rate_rad_s * dt_s
    chord = speed * dt_s
    if half_turn != 0.0:
        chord *= math.sin(half_turn) / half_turn
    heading = yaw_rad + half_turn
    return chord * math.cos(heading), chord * math.sin(heading)
