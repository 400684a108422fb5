"""What a physics control promises, against closed forms."""

from __future__ import annotations

import carla
import pytest

from benchmarks.simulator.straight_line import expectation

RADIUS_M = 0.34
MASS_KG = 1500.0


def physics(*, pull_m_s2: float = 4.0, brake_m_s2: float = 8.0) -> carla.VehiclePhysicsControl:
    """A car of one gear that pulls alike at every speed and meets no resistance of the air."""
    brake = brake_m_s2 * MASS_KG * RADIUS_M / 4.0
    wheels = [
        carla.WheelPhysicsControl(
            radius=100.0 * RADIUS_M, max_brake_torque=brake, max_steer_angle=steer
        )
        for steer in (70.0, 70.0, 0.0, 0.0)
    ]
    torque = pull_m_s2 * MASS_KG * RADIUS_M
    return carla.VehiclePhysicsControl(
        torque_curve=[carla.Vector2D(0.0, torque), carla.Vector2D(9000.0, torque)],
        max_rpm=9000.0,
        moi=0.0,
        damping_rate_full_throttle=0.0,
        final_ratio=1.0,
        forward_gears=[carla.GearPhysicsControl(ratio=1.0)],
        mass=MASS_KG,
        drag_coefficient=0.0,
        wheels=wheels,
    )


def test_times_and_ways_are_those_of_constant_accelerations() -> None:
    # The pedal's sixth of a second costs half of it; rolling takes 0.12 m/s2.
    found = expectation(physics())
    assert found.to_100_km_h_s == pytest.approx(27.78 / 3.88 + 0.083, rel=0.02)
    assert found.braking_m == pytest.approx(27.78**2 / (2 * 8.12) + 27.78 * 0.083, rel=0.02)


def test_less_torque_takes_longer_and_weaker_brakes_farther() -> None:
    whole, weak = expectation(physics()), expectation(physics(pull_m_s2=2.0, brake_m_s2=4.0))
    assert weak.to_100_km_h_s > 1.9 * whole.to_100_km_h_s
    assert weak.braking_m > 1.8 * whole.braking_m
