"""The fleet's struct of arrays: one column per quantity, one row per vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage_sim.world import vehicle_dynamics as dynamics
from carstage_sim.world.vehicle_parameters import VehicleParameters

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(slots=True)
class VehicleRows:
    """The columns, one row per vehicle. Angles in degrees, everything else in SI units."""

    ids: NDArray[np.uint32]
    location: FloatArray
    rotation_deg: FloatArray
    velocity: FloatArray
    angular_velocity_deg: FloatArray
    acceleration: FloatArray
    control: NDArray[np.float32]
    hand_brake: BoolArray
    reverse: BoolArray
    wheel_angle_deg: FloatArray
    speed: FloatArray
    fall_speed: FloatArray
    airborne: BoolArray
    free_yaw_rate: FloatArray
    simulated: BoolArray
    collides: BoolArray
    constant_velocity: FloatArray
    # Where this tick's motion is counted from.
    origin_location: FloatArray
    origin_rotation_deg: FloatArray
    front_axle_x: FloatArray
    rear_axle_x: FloatArray
    half_track: FloatArray
    max_steer_deg: FloatArray
    max_acceleration: FloatArray
    power_per_mass: FloatArray
    max_deceleration: FloatArray
    max_lateral_acceleration: FloatArray
    max_reverse_speed: FloatArray
    drag_per_mass: FloatArray
    inverse_mass: FloatArray
    box_center_x: FloatArray
    half_size: FloatArray
    steering_curve: FloatArray

    def append(self, values: Mapping[str, ArrayLike]) -> None:
        """Adds a row; columns without a value get zero."""
        for field in fields(self):
            column = getattr(self, field.name)
            row = np.zeros((1, *column.shape[1:]), dtype=column.dtype)
            if field.name in values:
                row[0] = values[field.name]
            setattr(self, field.name, np.concatenate([column, row]))

    def delete(self, row: int) -> None:
        """Removes a row; those after it move up."""
        for field in fields(self):
            setattr(self, field.name, np.delete(getattr(self, field.name), row, axis=0))

    def set(self, row: int, values: Mapping[str, ArrayLike]) -> None:
        """Overwrites some columns of a row."""
        for name, value in values.items():
            getattr(self, name)[row] = value


def empty_rows() -> VehicleRows:
    """All columns, without a row."""
    vectors = {
        "location",
        "rotation_deg",
        "velocity",
        "angular_velocity_deg",
        "acceleration",
        "constant_velocity",
        "origin_location",
        "origin_rotation_deg",
    }
    flags = {"hand_brake", "reverse", "airborne", "simulated", "collides"}
    columns: dict[str, NDArray[np.generic]] = {}
    for field in fields(VehicleRows):
        shape: tuple[int, ...] = (0, 3) if field.name in vectors else (0,)
        dtype = np.bool_ if field.name in flags else np.float64
        columns[field.name] = np.zeros(shape, dtype=dtype)
    columns["ids"] = np.zeros(0, dtype=np.uint32)
    columns["half_size"] = np.zeros((0, 2))
    columns["control"] = np.zeros((0, 3), dtype=np.float32)
    columns["steering_curve"] = np.zeros((0, dynamics.CURVE_POINTS))
    return VehicleRows(**columns)  # type: ignore[arg-type]


def parameter_values(parameters: VehicleParameters) -> dict[str, ArrayLike]:
    """The columns that follow from a vehicle's parameters alone."""
    return {
        "front_axle_x": parameters.front_axle_x_m,
        "rear_axle_x": parameters.rear_axle_x_m,
        "half_track": parameters.track_m / 2.0,
        "max_steer_deg": parameters.max_steer_angle_deg,
        "max_acceleration": parameters.max_acceleration,
        "power_per_mass": parameters.power_per_mass,
        "max_deceleration": parameters.max_deceleration,
        "max_lateral_acceleration": parameters.max_lateral_acceleration,
        "max_reverse_speed": parameters.max_reverse_speed,
        "drag_per_mass": parameters.drag_coefficient
        * dynamics.FRONTAL_AREA_TIMES_HALF_RHO
        / parameters.mass_kg,
        "inverse_mass": 1.0 / parameters.mass_kg,
        "box_center_x": parameters.box_center_x_m,
        "half_size": (parameters.half_length_m, parameters.half_width_m),
        "steering_curve": dynamics.sample_steering_curve(parameters.steering_curve),
    }
