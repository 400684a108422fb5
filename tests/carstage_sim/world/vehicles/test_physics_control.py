"""Every field of a physics control that a client can change changes the motion the right way."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from carstage_sim.world.controls import VehicleControl
from carstage_sim.world.vehicles.fleet import VehicleFleet
from carstage_sim.world.vehicles.parameters import Gear, VehicleParameters
from plain_scenes import CAR, drive, one_car, parameters, rolling, turned_deg

NORMAL = parameters()


def wheels(**changed: float) -> dict[str, Any]:
    return {"wheels": tuple(replace(wheel, **changed) for wheel in NORMAL.wheels)}


def speed_after_sprint(physics: VehicleParameters) -> float:
    fleet = one_car(physics=physics)
    drive(fleet, 4.2, throttle=1.0)  # the pedal takes a sixth of a second
    return float(fleet.speed[0])


def way_to_stop(physics: VehicleParameters, **pedals: Any) -> float:
    fleet = rolling(10.0, physics=physics)
    drive(fleet, 4.0, **(pedals or {"brake": 1.0}))
    return float(fleet.location[0, 0])


def way_to_stop_by_hand_brake(physics: VehicleParameters) -> float:
    return way_to_stop(physics, hand_brake=True)


def speed_after_coasting(physics: VehicleParameters) -> float:
    fleet = rolling(20.0, physics=physics)
    drive(fleet, 3.0)
    return float(fleet.speed[0])


def turn_at_speed(physics: VehicleParameters) -> float:
    fleet = rolling(15.0, physics=physics)
    drive(fleet, 1.0, steer=0.5)
    return turned_deg(fleet)


def gentle_turn(physics: VehicleParameters) -> float:
    fleet = rolling(8.0, physics=physics)
    drive(fleet, 1.0, steer=0.05)
    return turned_deg(fleet)


weak = {"torque_curve": tuple((rpm, 0.5 * torque) for rpm, torque in NORMAL.torque_curve)}
tall = {"forward_gears": tuple(replace(g, ratio=0.6 * g.ratio) for g in NORMAL.forward_gears)}
soft_steering = {"steering_curve": ((0.0, 1.0), (20.0, 0.4), (60.0, 0.2), (120.0, 0.1))}


@pytest.mark.parametrize(
    ("changed", "measured"),
    [
        ({"mass_kg": 2.0 * NORMAL.mass_kg}, speed_after_sprint),
        (weak, speed_after_sprint),
        (tall, speed_after_sprint),
        ({"final_ratio": 2.0}, speed_after_sprint),
        ({"moi": 5.0}, speed_after_sprint),
        ({"damping_rate_full_throttle": 0.5}, speed_after_sprint),
        ({"gear_switch_time_s": 2.0}, speed_after_sprint),
        ({"drag_coefficient": 8.0}, speed_after_sprint),
        (wheels(tire_friction=1.0), speed_after_sprint),
        ({"drag_coefficient": 3.0}, speed_after_coasting),
        ({"damping_rate_zero_throttle_clutch_engaged": 6.0}, speed_after_coasting),
        (wheels(tire_friction=1.5), turn_at_speed),
        ({"center_of_mass": (0.45, 0.0, 1.2)}, turn_at_speed),
        ({"center_of_mass": (1.2, 0.0, -0.3)}, gentle_turn),
        (soft_steering, gentle_turn),
    ],
)
def test_the_change_makes_it_less(
    changed: dict[str, Any], measured: Callable[[VehicleParameters], float]
) -> None:
    assert measured(replace(NORMAL, **changed)) < 0.97 * measured(NORMAL)


@pytest.mark.parametrize(
    ("changed", "measured"),
    [
        ({"mass_kg": 2.0 * NORMAL.mass_kg}, way_to_stop),
        (wheels(max_brake_torque=500.0), way_to_stop),
        (wheels(tire_friction=1.0), way_to_stop),
        (wheels(max_handbrake_torque=500.0), way_to_stop_by_hand_brake),
    ],
)
def test_the_change_makes_it_more(
    changed: dict[str, Any], measured: Callable[[VehicleParameters], float]
) -> None:
    assert measured(replace(NORMAL, **changed)) > 1.03 * measured(NORMAL)


def sprint_in_gear(gear: int, physics: VehicleParameters = NORMAL, seconds: float = 9.0) -> float:
    fleet = one_car(physics=physics)
    drive(fleet, seconds, throttle=1.0, manual_gear_shift=True, gear=gear)
    return float(fleet.speed[0])


def test_a_gear_that_is_held_ends_at_the_highest_engine_speed() -> None:
    radius_m = NORMAL.wheels[-1].radius_m
    for gear in (1, 2):
        ratio = NORMAL.forward_gears[gear - 1].ratio * NORMAL.final_ratio
        top = NORMAL.max_rpm / 60.0 * 2.0 * np.pi / ratio * radius_m
        assert sprint_in_gear(gear) == pytest.approx(top, rel=0.03)
    assert sprint_in_gear(1, replace(NORMAL, max_rpm=3000.0)) < 0.6 * sprint_in_gear(1)


def test_neutral_drives_nowhere_and_a_negative_gear_backwards() -> None:
    assert sprint_in_gear(0, seconds=2.0) == 0.0
    assert sprint_in_gear(-1, seconds=2.0) < -3.0


def test_the_automatic_box_shifts_up_and_down_and_one_that_is_off_does_not() -> None:
    fleet = one_car()
    gears = []
    for pedals in ({"throttle": 1.0}, {"brake": 1.0}):
        for _ in range(11):
            drive(fleet, 1.0, **pedals)
            gears.append(int(fleet.gear[0]))
    assert gears[0] == 1
    assert max(gears) == 4
    assert gears[-1] == 1
    stuck = one_car(physics=replace(NORMAL, use_gear_autobox=False))
    drive(stuck, 5.0, throttle=1.0)
    assert stuck.gear[0] == 1


def test_no_gear_box_hunts_between_two_gears() -> None:
    close = replace(NORMAL, forward_gears=tuple(Gear(r) for r in (3.0, 2.8, 2.6, 2.4, 1.0)))
    for physics in (NORMAL, close):
        fleet = one_car(physics=physics)
        fleet.set_control(CAR, VehicleControl(throttle=0.4))
        gears = []
        for _ in range(200):
            fleet.step(0.1, 5)
            gears.append(int(fleet.gear[0]))
        assert all(later >= earlier for earlier, later in itertools.pairwise(gears))


def test_water_on_the_road_lengthens_the_way_to_stop_a_little() -> None:
    def way(puddles: float) -> float:
        fleet = rolling(15.0)
        fleet.set_grip(puddles)
        drive(fleet, 5.0, brake=1.0)
        return float(fleet.location[0, 0])

    dry, damp, wet = way(0.0), way(50.0), way(100.0)
    assert dry < damp < wet < 1.6 * dry


def test_the_catalogue_keeps_its_accelerations_whatever_its_engines() -> None:
    for type_id in (
        "vehicle.tesla.model3",
        "vehicle.carlamotors.firetruck",
        "vehicle.bh.crossbike",
    ):
        physics = parameters(type_id)
        fleet: VehicleFleet = one_car(physics=physics)
        drive(fleet, 0.2, throttle=1.0)  # until the pedal is down
        before = fleet.speed[0]
        drive(fleet, 0.3, throttle=1.0)
        gained = (fleet.speed[0] - before) / 0.3
        assert gained == pytest.approx(physics.max_acceleration, rel=0.25)


def test_nothing_slows_a_vehicle_whose_tyres_do_not_hold_and_that_has_no_drag() -> None:
    fleet = rolling(28.0, physics=parameters(drag_coefficient=0.0, **wheels(tire_friction=0.0)))
    drive(fleet, 5.0)
    np.testing.assert_allclose(fleet.velocity[0], (28.0, 0.0, 0.0))
    drive(fleet, 5.0, brake=1.0)
    np.testing.assert_allclose(fleet.velocity[0], (28.0, 0.0, 0.0))


def test_drag_below_zero_is_none() -> None:
    physics = parameters(drag_coefficient=-1e4, **wheels(tire_friction=0.0))
    fleet = rolling(28.0, physics=physics)
    drive(fleet, 5.0)
    np.testing.assert_allclose(fleet.velocity[0], (28.0, 0.0, 0.0))
