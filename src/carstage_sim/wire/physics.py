"""Physics control and telemetry of vehicles as msgpack values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from carstage_sim.geometry import pose_matrix
from carstage_sim.wire import values
from carstage_sim.wire.errors import CallError
from carstage_sim.world.pose import Pose, Vector3
from carstage_sim.world.vehicles.parameters import Gear, VehicleParameters, Wheel
from carstage_sim.world.vehicles.poses import VehicleMotion

_CM_PER_M = 100.0
_IDLE_RPM = 800.0
_GRAVITY = 9.81
_DRAG_FACTOR = 0.5 * 1.2 * 2.2  # air density times a car's frontal area, halved


def encode_physics(parameters: VehicleParameters, world_from_vehicle: Pose) -> list[Any]:
    """A ``VehiclePhysicsControl``; wheel positions are world centimetres, as CARLA reports them."""
    matrix = pose_matrix(world_from_vehicle.location, world_from_vehicle.rotation_deg)
    wheels = []
    for wheel in parameters.wheels:
        position = (matrix @ np.array([*wheel.position_m, 1.0]))[:3] * _CM_PER_M
        wheels.append(
            [
                wheel.tire_friction,
                wheel.damping_rate,
                wheel.max_steer_angle_deg,
                wheel.radius_m * _CM_PER_M,
                wheel.max_brake_torque,
                wheel.max_handbrake_torque,
                wheel.lat_stiff_max_load,
                wheel.lat_stiff_value,
                wheel.long_stiff_value,
                position.tolist(),
            ]
        )
    p = parameters
    return [
        [list(point) for point in p.torque_curve],
        p.max_rpm,
        p.moi,
        p.damping_rate_full_throttle,
        p.damping_rate_zero_throttle_clutch_engaged,
        p.damping_rate_zero_throttle_clutch_disengaged,
        p.use_gear_autobox,
        p.gear_switch_time_s,
        p.clutch_strength,
        p.final_ratio,
        [[gear.ratio, gear.down_ratio, gear.up_ratio] for gear in p.forward_gears],
        p.mass_kg,
        p.drag_coefficient,
        list(p.center_of_mass),
        [list(point) for point in p.steering_curve],
        wheels,
        p.use_sweep_wheel_collision,
    ]


def decode_physics(value: Sequence[Any], before: VehicleParameters) -> VehicleParameters:
    """The parameters that a client set; what the dynamics alone know stays as it was.

    Wheel positions stay too: clients give back world positions of an earlier moment. So do empty
    curves, gears and wheels, and wheels that are missing at the end.

    Raises:
        CallError: a number that no vehicle can have.
    """
    given = tuple(
        _wheel(wheel, old.position_m) for wheel, old in zip(value[15], before.wheels, strict=False)
    )
    wheels = given + before.wheels[len(given) :]
    values.finite(*value[1:6], *value[7:10], value[12])
    (mass_kg,) = values.finite(value[11])
    if mass_kg <= 0.0 or min(wheel.radius_m for wheel in wheels) <= 0.0:
        raise CallError("a vehicle's mass and the radius of its wheels must be positive")
    return replace(
        before,
        torque_curve=_curve(value[0]) or before.torque_curve,
        max_rpm=value[1],
        moi=value[2],
        damping_rate_full_throttle=value[3],
        damping_rate_zero_throttle_clutch_engaged=value[4],
        damping_rate_zero_throttle_clutch_disengaged=value[5],
        use_gear_autobox=value[6],
        gear_switch_time_s=value[7],
        clutch_strength=value[8],
        final_ratio=value[9],
        forward_gears=tuple(Gear(*values.finite(*gear)) for gear in value[10])
        or before.forward_gears,
        mass_kg=mass_kg,
        drag_coefficient=value[12],
        center_of_mass=values.vector(value[13]),
        steering_curve=_curve(value[14]) or before.steering_curve,
        wheels=wheels,
        use_sweep_wheel_collision=value[16],
    )


def _wheel(value: Sequence[Any], position_m: Vector3) -> Wheel:
    friction, damping, steer, radius_cm, brake, hand_brake, load, lateral, longitudinal = (
        values.finite(*value[:9])
    )
    return Wheel(
        position_m=position_m,
        radius_m=radius_cm / _CM_PER_M,
        max_steer_angle_deg=steer,
        max_handbrake_torque=hand_brake,
        tire_friction=friction,
        damping_rate=damping,
        max_brake_torque=brake,
        lat_stiff_max_load=load,
        lat_stiff_value=lateral,
        long_stiff_value=longitudinal,
    )


def _curve(points: Sequence[Sequence[float]]) -> tuple[tuple[float, float], ...]:
    curve = (values.finite(*point) for point in points)
    return tuple((x, y) for x, y in curve)


def encode_telemetry(parameters: VehicleParameters, motion: VehicleMotion) -> list[Any]:
    """A ``VehicleTelemetryData``: rolling wheels without slip, the engine geared to them."""
    wheel_count = len(parameters.wheels)
    radius_m = parameters.wheels[0].radius_m
    omega = motion.speed / radius_m
    ratio = parameters.forward_gears[max(motion.gear, 1) - 1].ratio * parameters.final_ratio
    rpm = abs(omega) * ratio * 60.0 / (2.0 * math.pi)
    drag = _DRAG_FACTOR * parameters.drag_coefficient * motion.speed**2
    load = parameters.mass_kg * _GRAVITY / wheel_count
    force = parameters.mass_kg * motion.forward_acceleration / wheel_count
    lateral = parameters.mass_kg * motion.lateral_acceleration / wheel_count
    wheels = [
        [
            wheel.tire_friction,
            0.0,
            0.0,
            omega,
            load,
            1.0,
            force * wheel.radius_m,
            force,
            lateral,
            force / load,
            lateral / load,
        ]
        for wheel in parameters.wheels
    ]
    return [
        motion.speed,
        motion.steer,
        motion.throttle,
        motion.brake,
        min(max(rpm, _IDLE_RPM), parameters.max_rpm),
        motion.gear,
        drag,
        wheels,
    ]
