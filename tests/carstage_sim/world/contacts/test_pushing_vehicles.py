"""Impulses, forces, torques, teleports: what acts at once and what acts for one step."""

from __future__ import annotations

import numpy as np
import pytest

from plain_scenes import CAR, DELTA_S, drive, one_car, parameters, rolling

MASS_KG = parameters().mass_kg


def test_an_impulse_adds_to_a_velocity_that_was_set_in_the_same_tick() -> None:
    fleet = one_car()
    fleet.set_target_velocity(CAR, (10.0, 0.0, 0.0))
    fleet.add_impulse(CAR, (5.0 * MASS_KG, 0.0, 0.0))
    fleet.step(DELTA_S, 5)
    assert fleet.velocity[0, 0] == pytest.approx(15.0, abs=0.2)


def test_a_force_acts_for_one_step_and_as_long_as_the_step() -> None:
    gained = []
    for delta_s in (0.05, 0.1):
        fleet = rolling(10.0)
        fleet.step(delta_s, 10)
        before = float(fleet.speed[0])
        fleet.add_force(CAR, (20.0 * MASS_KG, 0.0, 0.0))
        fleet.step(delta_s, 10)
        gained.append(float(fleet.speed[0]) - before)
        pushed = float(fleet.speed[0])
        fleet.step(delta_s, 10)
        assert float(fleet.speed[0]) < pushed
    assert gained[0] == pytest.approx(20.0 * 0.05, rel=0.05)
    assert gained[1] == pytest.approx(20.0 * 0.1, rel=0.05)


def test_a_brake_holds_against_a_small_force_and_not_against_a_large_one() -> None:
    for share, moves in ((0.5, False), (1.5, True)):
        fleet = one_car()
        start = fleet.location[0, 0]
        for _ in range(10):
            fleet.add_force(CAR, (share * 9.0 * MASS_KG, 0.0, 0.0))
            drive(fleet, DELTA_S, brake=1.0)
        assert bool(fleet.location[0, 0] - start > 0.1) is moves


def test_an_upward_impulse_lifts_off_and_gravity_brings_back() -> None:
    fleet = one_car()
    fleet.add_impulse(CAR, (0.0, 0.0, 5.0 * MASS_KG))
    drive(fleet, 0.5)
    assert fleet.location[0, 2] == pytest.approx(5.0 * 0.5 - 9.81 * 0.125, abs=0.05)
    drive(fleet, 1.0)
    assert fleet.location[0, 2] == 0.0


def test_an_impulse_beside_the_middle_spins_and_tyres_end_the_spin() -> None:
    fleet = one_car()
    fleet.add_impulse(CAR, (0.0, 4.0 * MASS_KG, 0.0), (2.0, 0.0, 0.0))
    fleet.step(DELTA_S, 5)
    assert fleet.angular_velocity_deg[0, 2] > 30.0
    drive(fleet, 1.0)
    assert fleet.angular_velocity_deg[0, 2] == 0.0
    drive(fleet, 0.5, brake=1.0)
    np.testing.assert_array_equal(fleet.velocity[0], 0.0)


def test_torque_and_angular_impulse_spin_about_the_vertical() -> None:
    impulse, torque = one_car(), one_car()
    impulse.add_angular_impulse(CAR, 20_000.0)
    torque.add_torque(CAR, 20_000.0 / DELTA_S)
    for fleet in (impulse, torque):
        fleet.step(DELTA_S, 5)
        assert fleet.angular_velocity_deg[0, 2] > 50.0
    torque.step(DELTA_S, 5)
    assert torque.angular_velocity_deg[0, 2] < 250.0


def test_a_teleport_in_motion_keeps_the_velocity_in_the_world() -> None:
    fleet = rolling(10.0)
    fleet.step(DELTA_S, 5)
    fleet.set_transform(CAR, (100.0, 50.0, 0.0), (0.0, 90.0, 0.0))
    fleet.step(DELTA_S, 5)
    assert fleet.velocity[0, 0] == pytest.approx(10.0, abs=0.5)
    assert fleet.location[0, 0] == pytest.approx(100.5, abs=0.05)
    drive(fleet, 3.0)  # sideways, its tyres stop it
    np.testing.assert_allclose(fleet.velocity[0], 0.0, atol=1e-6)


def test_without_physics_nothing_moves_a_vehicle_but_a_teleport() -> None:
    fleet = rolling(10.0)
    fleet.set_simulate_physics(CAR, False)
    before = fleet.location[0].copy()
    fleet.add_impulse(CAR, (9e4, 0.0, 0.0))
    fleet.add_force(CAR, (9e5, 0.0, 0.0))
    drive(fleet, 1.0, throttle=1.0)
    np.testing.assert_array_equal(fleet.location[0], before)
    np.testing.assert_array_equal(fleet.velocity[0], 0.0)


def test_physics_that_lose_time_report_the_speed_at_which_vehicles_move() -> None:
    fleet = rolling(10.0)
    fleet.step(0.5, 10, moving_s=0.1)
    assert fleet.velocity[0, 0] == pytest.approx(10.0, abs=0.1)
    assert fleet.location[0, 0] == pytest.approx(1.0, abs=0.02)
