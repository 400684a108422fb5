"""From the throttle to the wheels: torque curve, gear box and brakes of a fleet.

The engine turns with the driven wheels, so its speed follows from the vehicle's and the gear's
ratio. What it pushes a vehicle of mass m with, at the wheels of radius r, through the total ratio
R, while it must also turn its own moment of inertia J, is the textbook's
``a = T R / (r (m + J R² / r²))`` (Rajamani, "Vehicle Dynamics and Control", chapter 5). The torque
curve is scaled once per blueprint, so that full throttle in first gear gives the blueprint's
``max_acceleration``, and so are the brakes. So whoever computes with the physics control that a
client is told finds the vehicle's own motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage_sim.kernels import device
from carstage_sim.world.vehicles.parameters import VehicleParameters

FloatArray = NDArray[np.float64]

MAX_GEARS = 10
"""Forward gears that count; a client may send more."""
CURVE_POINTS = 24
"""Samples of a torque curve, from standstill to the highest engine speed."""

CLUTCH_OPENS_S, CLUTCH_CLOSES_S = 0.15, 0.3
"""How long it takes; together they fit into the half second that CARLA's boxes shift in."""

_REVERSE_RATIO = 4.0  # PhysX's default; CARLA's physics control has no field for it
_HYSTERESIS = 1.05  # how far above a gear's lower shift point its upper one is at least
_LAST_SHIFT = 0.97  # of the highest engine speed
_RPM = 60.0 / (2.0 * np.pi)
_TORQUE_DECIMALS = 1


def calibrated(parameters: VehicleParameters) -> VehicleParameters:
    """Parameters of a blueprint whose drive and brakes give its stated accelerations."""
    force_per_torque = np.asarray(gear_values(parameters)["force_per_torque"])[1]
    torque, losses = _torque_and_losses(parameters)
    needed = parameters.max_acceleration / force_per_torque
    drive = float(((needed + losses) / torque).min())  # the strongest point gives what is needed
    brake = sum(wheel.max_brake_torque / wheel.radius_m for wheel in parameters.wheels)
    hold = parameters.max_deceleration * parameters.mass_kg / brake
    return replace(
        parameters,
        blueprint_mass_kg=parameters.mass_kg,
        torque_curve=tuple(
            (rpm, round(drive * value, _TORQUE_DECIMALS)) for rpm, value in parameters.torque_curve
        ),
        wheels=tuple(
            replace(
                wheel,
                max_brake_torque=round(hold * wheel.max_brake_torque, _TORQUE_DECIMALS),
                max_handbrake_torque=round(hold * wheel.max_handbrake_torque, _TORQUE_DECIMALS),
            )
            for wheel in parameters.wheels
        ),
    )


def _torque_and_losses(parameters: VehicleParameters) -> tuple[FloatArray, FloatArray]:
    """Torque at full throttle and what the engine's damping takes of it, ``(24,)`` N m each."""
    rpm = np.linspace(0.0, max(parameters.max_rpm, 1.0), CURVE_POINTS)
    speeds, torques = np.array(sorted(parameters.torque_curve), dtype=np.float64).T
    losses = max(parameters.damping_rate_full_throttle, 0.0) * rpm / _RPM
    return np.asarray(np.interp(rpm, speeds, torques)), np.asarray(losses)


def gear_values(parameters: VehicleParameters) -> dict[str, ArrayLike]:
    """The columns of engine and gear box; index 0 of the gears is reverse, 1 the first gear."""
    gears = parameters.forward_gears[:MAX_GEARS]
    ratios = np.zeros(MAX_GEARS + 1)
    ratios[0] = _REVERSE_RATIO
    ratios[1 : len(gears) + 1] = [gear.ratio for gear in gears]
    ratios = np.abs(ratios * parameters.final_ratio)
    driven = [w for w in parameters.wheels if w.max_steer_angle_deg == 0.0] or parameters.wheels
    radius_m = sum(wheel.radius_m for wheel in driven) / len(driven)
    mass_kg = parameters.mass_kg + max(parameters.moi, 0.0) * (ratios / radius_m) ** 2
    rpm_per_speed = ratios / radius_m * _RPM
    max_rpm = max(parameters.max_rpm, 1.0)
    down, up = np.zeros(MAX_GEARS + 1), np.full(MAX_GEARS + 1, np.inf)
    lowest = np.full(MAX_GEARS + 1, np.inf)
    for index, gear in enumerate(gears, start=1):
        if index > 1:
            down[index] = gear.down_ratio * max_rpm / rpm_per_speed[index]
        if index < len(gears):
            # A shift that would be taken back at once is none.
            back = gears[index].down_ratio * _HYSTERESIS * ratios[index] / ratios[index + 1]
            share = min(max(gear.up_ratio, back), _LAST_SHIFT)
            up[index] = share * max_rpm / rpm_per_speed[index]
            lowest[index + 1] = up[index] / _HYSTERESIS
    torque, losses = _torque_and_losses(parameters)
    return {
        "torque": np.maximum(torque - losses, 0.0),
        "max_rpm": max_rpm,
        "rpm_per_speed": rpm_per_speed,
        "force_per_torque": ratios / (radius_m * mass_kg),
        "gear_count": len(gears),
        "shift_up_speed": up,
        "shift_down_speed": np.minimum(down, lowest),
        "shift_time": max(parameters.gear_switch_time_s, 0.0),
        "auto_box": parameters.use_gear_autobox,
    }


@device
def drive_acceleration(  # type: ignore[no-untyped-def]
    row, speed, gear, torque, max_rpm, rpm_per_speed, force_per_torque
):
    """Acceleration at full throttle, m/s², of any gear but neutral (there it is 0).

    Args:
        row: of the vehicle in the columns.
        speed: m/s, of any sign.
        gear: -1 for reverse, 0 for neutral.
        torque: ``(N, 24)`` N m from standstill to ``max_rpm``.
        max_rpm: ``(N,)``.
        rpm_per_speed, force_per_torque: ``(N, 11)`` by gear, index 0 for reverse.
    """
    index = max(gear, 0)
    share = abs(speed) * rpm_per_speed[row, index] / max_rpm[row]
    if gear == 0 or not share < 1.0:
        return 0.0
    position = share * (CURVE_POINTS - 1.001)
    low = int(position)
    part = position - low
    pull = torque[row, low] * (1.0 - part) + torque[row, low + 1] * part
    return pull * force_per_torque[row, index]


@device
def shifted(row, gear, speed, shift_up_speed, shift_down_speed):  # type: ignore[no-untyped-def]
    """The gear after an automatic box in a forward gear has looked at the speed.

    Args:
        row: of the vehicle in the columns.
        shift_up_speed, shift_down_speed: ``(N, 11)`` by gear, m/s.
    """
    if abs(speed) > shift_up_speed[row, gear]:
        return gear + 1
    if abs(speed) < shift_down_speed[row, gear]:
        return gear - 1
    return gear


@device
def clutch(left_s, shift_time_s):  # type: ignore[no-untyped-def]
    """Share of the drive that gets through while the box shifts, 0 to 1.

    It opens as a shift begins and closes towards its end, so that no shift is a jolt.

    Args:
        left_s: of the shift, 0 for none.
        shift_time_s: how long a shift takes.
    """
    opening = 1.0 - (shift_time_s - left_s) / CLUTCH_OPENS_S
    closing = 1.0 - left_s / CLUTCH_CLOSES_S
    return min(max(opening, closing, 0.0), 1.0)
