"""Vehicles on slopes, kerbs, bridges, and where there is nothing to stand on."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carstage_sim.mesh import merge_meshes
from carstage_sim.world.controls import VehicleControl
from carstage_sim.world.vehicles.dynamics import GRAVITY
from plain_scenes import CAR, drive, fleet_on, one_car, parameters, plain, sheet


def hill(grade: float):
    return sheet((-500.0, -50.0), (500.0, 50.0), lambda x, _y: grade * x)


def test_a_released_car_rolls_down_a_hill_and_a_braked_one_stays() -> None:
    fleet = one_car(hill(0.08), at=(0.0, 0.0, 0.0))
    drive(fleet, 2.0, brake=0.5)
    assert fleet.location[0, 0] == pytest.approx(0.0, abs=0.02)
    drive(fleet, 2.0, manual_gear_shift=True, gear=0)
    assert -2.0 < fleet.speed[0] < -0.8
    pitch_deg = math.degrees(math.atan(0.08))
    assert fleet.rotation_deg[0, 0] == pytest.approx(pitch_deg, abs=0.01)
    assert fleet.location[0, 2] == pytest.approx(0.08 * fleet.location[0, 0], abs=0.01)


def test_uphill_is_slower_than_downhill() -> None:
    reached = []
    for grade in (-0.08, 0.08):
        fleet = one_car(hill(grade))
        drive(fleet, 4.0, throttle=0.6)
        reached.append(float(fleet.speed[0]))
    # Twice the slope's share of gravity over four seconds.
    assert reached[0] - reached[1] == pytest.approx(2 * 0.08 * GRAVITY * 4.0, rel=0.35)


def test_a_kerb_is_a_short_ramp_and_no_jump() -> None:
    upper = sheet((20.0, -50.0), (500.0, 50.0), lambda _x, _y: 0.15)
    fleet = one_car(merge_meshes([sheet((-500.0, -50.0), (20.0, 50.0)), upper]))
    fleet.set_target_velocity(CAR, (8.0, 0.0, 0.0))
    heights, pitches = [], []
    for _ in range(200):
        fleet.step(0.02, 2)
        heights.append(float(fleet.location[0, 2]))
        pitches.append(float(fleet.rotation_deg[0, 0]))
    assert np.abs(np.diff(heights)).max() < 0.04
    assert np.abs(np.diff(pitches)).max() < 1.2
    assert heights[-1] == pytest.approx(0.15, abs=1e-3)
    assert pitches[-1] == pytest.approx(0.0, abs=0.01)


def test_on_an_even_slope_a_fast_car_neither_sinks_nor_floats() -> None:
    fleet = one_car(hill(0.08), at=(-200.0, 0.0, -16.0))
    fleet.set_target_velocity(CAR, (30.0, 0.0, 2.4))
    for _ in range(60):
        fleet.step(0.1, 10)
        assert fleet.location[0, 2] == pytest.approx(0.08 * fleet.location[0, 0], abs=0.01)


@pytest.mark.parametrize("height", [0.0, 6.0])
def test_a_car_drives_on_the_level_that_it_is_on(height: float) -> None:
    roadway = sheet((-400.0, -6.0), (400.0, 6.0), lambda _x, _y: 6.0)
    fleet = one_car(plain(roadway), at=(0.0, 0.0, height))
    drive(fleet, 4.0, throttle=0.8)
    assert fleet.location[0, 0] > 15.0
    assert fleet.location[0, 2] == pytest.approx(height, abs=1e-6)


def test_what_is_dropped_falls_freely_and_lands() -> None:
    fleet = fleet_on(plain())
    fleet.add(CAR, parameters(), (0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
    for _ in range(10):
        fleet.step(0.1, 10)
    assert fleet.location[0, 2] == pytest.approx(5.0 - GRAVITY / 2.0, abs=1e-6)
    fleet.step(0.1, 10)
    assert fleet.location[0, 2] == 0.0


@pytest.mark.parametrize(
    ("pitch_deg", "roll_deg"),
    [(30.0, 0.0), (-40.0, 0.0), (60.0, 0.0), (-90.0, 0.0), (0.0, 60.0), (0.0, 90.0), (50.0, 240.0)],
)
def test_what_is_dropped_on_its_nose_or_side_lands_on_its_wheels(
    pitch_deg: float, roll_deg: float
) -> None:
    fleet = fleet_on(plain(sheet((-400.0, -6.0), (400.0, 6.0), lambda _x, _y: 6.0)))
    fleet.add(CAR, parameters(), (0.0, 0.0, 3.0), (pitch_deg, 0.0, roll_deg))
    drive(fleet, 3.0)
    assert fleet.location[0].tolist() == [0.0, 0.0, 0.0]
    assert fleet.rotation_deg[0].tolist() == [0.0, 0.0, 0.0]


def test_a_car_that_leaves_the_last_road_falls_on_and_on() -> None:
    fleet = one_car(sheet((-50.0, -50.0), (20.0, 50.0)))
    fleet.set_target_velocity(CAR, (15.0, 0.0, 0.0))
    drive(fleet, 4.0)
    assert fleet.location[0, 2] < -20.0
    assert fleet.velocity[0, 2] < -15.0


def test_without_gravity_a_car_in_the_air_stays_there() -> None:
    fleet = fleet_on(plain())
    fleet.add(CAR, parameters(), (0.0, 0.0, 3.0), (0.0, 0.0, 0.0))
    fleet.set_gravity(CAR, False)
    fleet.set_control(CAR, VehicleControl(throttle=1.0))
    drive(fleet, 1.0)
    assert fleet.location[0].tolist() == [0.0, 0.0, 3.0]
    fleet.set_gravity(CAR, True)
    drive(fleet, 1.0)
    assert fleet.location[0, 2] == 0.0


def test_drag_only_slows_what_flies_however_fast_it_was_made() -> None:
    fleet = fleet_on(plain())
    fleet.add(CAR, parameters(), (0.0, 0.0, 50.0), (0.0, 0.0, 0.0))
    fleet.set_target_velocity(CAR, (1e9, 0.0, 0.0))
    speeds = []
    for _ in range(10):
        fleet.step(0.05, 5)
        speeds.append(float(fleet.speed[0]))
    assert np.all(np.diff(speeds, prepend=1e9) <= 0.0)
    assert speeds[-1] >= 0.0
    assert np.isfinite(fleet.location).all()
