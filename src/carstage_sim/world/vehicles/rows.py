"""The fleet's struct of arrays: one column per quantity, one row per vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage_sim.world.vehicles import dynamics as dynamics
from carstage_sim.world.vehicles import powertrain
from carstage_sim.world.vehicles.parameters import VehicleParameters

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

_NORMAL_MASS_HEIGHT_M = 0.55  # of a car's centre of mass above the road, with CARLA's offset of it
_NORMAL_OFFSET = (0.45, -0.3)
"""``center_of_mass`` x and z of CARLA's cars: what the blueprint's handling belongs to."""
_NORMAL_ENGINE_DAMPING = 2.0
_UNDERSTEER_PER_M = 0.002  # s²/m² of centre of mass further ahead than normal


@dataclass(slots=True)
class VehicleRows:
    """The columns, one row per vehicle. Angles in degrees, everything else in SI units.

    Motion is that of the middle of the rear axle: ``speed`` along the heading, ``slide`` to the
    right of it, ``spin`` (rad/s) on top of the turn that the front wheels steer, ``vertical_speed``
    upwards while in the air. ``throttle`` and ``brake`` are where the pedals are, ``control`` where
    they are to go.
    """

    ids: NDArray[np.uint32]
    location: FloatArray
    rotation_deg: FloatArray
    velocity: FloatArray
    angular_velocity_deg: FloatArray
    acceleration: FloatArray
    # What clients command.
    control: NDArray[np.float32]
    hand_brake: BoolArray
    manual: BoolArray
    simulated: BoolArray
    gravity: BoolArray
    collides: BoolArray
    constant_velocity: FloatArray
    force: FloatArray
    torque_up: FloatArray
    # What signs tell the driver; 0 before the first tick.
    speed_limit_kmh: NDArray[np.float32]
    # Motion.
    speed: FloatArray
    slide: FloatArray
    spin: FloatArray
    turn_rate: FloatArray
    vertical_speed: FloatArray
    airborne: BoolArray
    wheel_angle_deg: FloatArray
    throttle: FloatArray
    brake: FloatArray
    gear: IntArray
    shift_left_s: FloatArray
    grip: FloatArray
    # Way along the heading since it was spawned, metres.
    rolled_m: FloatArray
    # Where this tick's motion is counted from.
    origin_location: FloatArray
    origin_rotation_deg: FloatArray
    # Parameters.
    front_axle_x: FloatArray
    rear_axle_x: FloatArray
    half_track: FloatArray
    max_steer_deg: FloatArray
    steering_curve: FloatArray
    understeer: FloatArray
    power_per_mass: FloatArray
    brake_deceleration: FloatArray
    hand_brake_deceleration: FloatArray
    engine_brake: FloatArray
    max_deceleration: FloatArray
    max_lateral_acceleration: FloatArray
    rollover_acceleration: FloatArray
    max_reverse_speed: FloatArray
    drag_per_mass: FloatArray
    tire_friction: FloatArray
    inverse_mass: FloatArray
    inverse_inertia: FloatArray
    box_center_x: FloatArray
    half_size: FloatArray
    height: FloatArray
    torque: FloatArray
    max_rpm: FloatArray
    rpm_per_speed: FloatArray
    force_per_torque: FloatArray
    gear_count: IntArray
    shift_up_speed: FloatArray
    shift_down_speed: FloatArray
    shift_time: FloatArray
    auto_box: BoolArray

    def insert(self, row: int, values: Mapping[str, ArrayLike]) -> None:
        """Adds a row before another; columns without a value get zero."""
        for field in fields(self):
            column = getattr(self, field.name)
            value = values.get(field.name, 0)
            setattr(self, field.name, np.insert(column, row, value, axis=0))

    def delete(self, row: int) -> None:
        """Removes a row; those after it move up."""
        for field in fields(self):
            setattr(self, field.name, np.delete(getattr(self, field.name), row, axis=0))

    def set(self, row: int, values: Mapping[str, ArrayLike]) -> None:
        """Overwrites some columns of a row."""
        for name, value in values.items():
            getattr(self, name)[row] = value


_WIDTH = {
    "location": 3,
    "rotation_deg": 3,
    "velocity": 3,
    "angular_velocity_deg": 3,
    "acceleration": 3,
    "constant_velocity": 3,
    "force": 3,
    "origin_location": 3,
    "origin_rotation_deg": 3,
    "control": 3,
    "half_size": 2,
    "steering_curve": dynamics.CURVE_POINTS,
    "torque": powertrain.CURVE_POINTS,
    "rpm_per_speed": powertrain.MAX_GEARS + 1,
    "force_per_torque": powertrain.MAX_GEARS + 1,
    "shift_up_speed": powertrain.MAX_GEARS + 1,
    "shift_down_speed": powertrain.MAX_GEARS + 1,
}
_DTYPE: dict[str, type[Any]] = {
    "ids": np.uint32,
    "control": np.float32,
    "speed_limit_kmh": np.float32,
    "hand_brake": np.bool_,
    "manual": np.bool_,
    "simulated": np.bool_,
    "gravity": np.bool_,
    "collides": np.bool_,
    "airborne": np.bool_,
    "auto_box": np.bool_,
    "gear": np.int64,
    "gear_count": np.int64,
}


def empty_rows() -> VehicleRows:
    """All columns, without a row."""
    columns: dict[str, Any] = {}
    for field in fields(VehicleRows):
        width = _WIDTH.get(field.name)
        shape = (0,) if width is None else (0, width)
        columns[field.name] = np.zeros(shape, dtype=_DTYPE.get(field.name, np.float64))
    return VehicleRows(**columns)


def parameter_values(parameters: VehicleParameters) -> dict[str, ArrayLike]:
    """The columns that follow from a vehicle's parameters alone."""
    wheels, mass_kg = parameters.wheels, parameters.mass_kg
    brake = sum(wheel.max_brake_torque / wheel.radius_m for wheel in wheels)
    hand_brake = sum(wheel.max_handbrake_torque / wheel.radius_m for wheel in wheels)
    length, width = 2.0 * parameters.half_length_m, 2.0 * parameters.half_width_m
    ahead_m = parameters.center_of_mass[0] - _NORMAL_OFFSET[0]
    height_m = _NORMAL_MASS_HEIGHT_M + parameters.center_of_mass[2] - _NORMAL_OFFSET[1]
    return {
        "front_axle_x": parameters.front_axle_x_m,
        "rear_axle_x": parameters.rear_axle_x_m,
        "half_track": parameters.track_m / 2.0,
        "max_steer_deg": parameters.max_steer_angle_deg,
        "steering_curve": dynamics.sample_steering_curve(parameters.steering_curve),
        "understeer": _UNDERSTEER_PER_M * max(ahead_m, 0.0),
        "power_per_mass": parameters.power_per_mass
        * (parameters.blueprint_mass_kg or mass_kg)
        / mass_kg,
        "brake_deceleration": parameters.brake_gain * brake / mass_kg,
        "hand_brake_deceleration": parameters.brake_gain * hand_brake / mass_kg,
        "engine_brake": max(parameters.damping_rate_zero_throttle_clutch_engaged, 0.0)
        / _NORMAL_ENGINE_DAMPING,
        "max_deceleration": parameters.max_deceleration,
        "max_lateral_acceleration": parameters.max_lateral_acceleration,
        "rollover_acceleration": dynamics.rollover_acceleration(parameters.track_m, height_m),
        "max_reverse_speed": parameters.max_reverse_speed,
        "drag_per_mass": max(parameters.drag_coefficient, 0.0)
        * dynamics.FRONTAL_AREA_TIMES_HALF_RHO
        / mass_kg,
        "tire_friction": sum(wheel.tire_friction for wheel in wheels) / len(wheels),
        "inverse_mass": 1.0 / mass_kg,
        # A homogeneous box about its vertical axis.
        "inverse_inertia": 12.0 / (mass_kg * (length**2 + width**2)),
        "box_center_x": parameters.box_center_x_m,
        "half_size": (parameters.half_length_m, parameters.half_width_m),
        "height": parameters.height_m,
        **powertrain.gear_values(parameters),
    }
