"""From the throttle to the wheels: torque curve, gear box and brakes of a fleet.

The engine turns with the driven wheels (no clutch slip), so its speed follows from the vehicle's
and the gear's ratio. What it pushes a vehicle of mass m with, at the wheels of radius r, through
the total ratio R, while it must also turn its own moment of inertia J, is the textbook's
``a = efficiency T R / (r (m + J R² / r²))`` (Rajamani, "Vehicle Dynamics and Control", chapter 5).
The efficiency is set once per blueprint, so that full throttle in first gear gives the blueprint's
``max_acceleration``; whatever a client then changes shows as it does in that formula.
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

_REVERSE_RATIO = 4.0  # PhysX's default; CARLA's physics control has no field for it
_HYSTERESIS = 1.05  # how far above a gear's lower shift point its upper one is at least
_LAST_SHIFT = 0.97  # of the highest engine speed
_RPM = 60.0 / (2.0 * np.pi)


def calibrated(parameters: VehicleParameters) -> VehicleParameters:
    """Parameters of a blueprint whose drive and brakes give its stated accelerations."""
    unscaled = gear_values(replace(parameters, drivetrain_efficiency=1.0))
    pull = np.asarray(unscaled["force_per_torque"])[1] * np.asarray(unscaled["torque"]).max()
    brake = sum(wheel.max_brake_torque / wheel.radius_m for wheel in parameters.wheels)
    return replace(
        parameters,
        blueprint_mass_kg=parameters.mass_kg,
        drivetrain_efficiency=float(parameters.max_acceleration / pull),
        brake_gain=parameters.max_deceleration * parameters.mass_kg / brake,
    )


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
    rpm = np.linspace(0.0, max_rpm, CURVE_POINTS)
    speeds, torques = np.array(sorted(parameters.torque_curve), dtype=np.float64).T
    losses = max(parameters.damping_rate_full_throttle, 0.0) * rpm / _RPM
    return {
        "torque": np.maximum(np.interp(rpm, speeds, torques) - losses, 0.0),
        "max_rpm": max_rpm,
        "rpm_per_speed": rpm_per_speed,
        "force_per_torque": parameters.drivetrain_efficiency * ratios / (radius_m * mass_kg),
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
