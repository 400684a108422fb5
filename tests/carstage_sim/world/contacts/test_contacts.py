"""Vehicles do not drive through each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.affinity import rotate, translate
from shapely.geometry import Polygon, box

from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.contacts.boxes import find_contacts
from carstage_sim.world.controls import VehicleControl
from carstage_sim.world.vehicles.fleet import VehicleFleet

HALF = np.array([[2.4, 1.0], [1.9, 0.9]])
LEVEL = np.array([[0.15, 1.5], [0.15, 1.5]])


def footprint(x: float, y: float, yaw_rad: float, half: np.ndarray) -> Polygon:
    shape = box(-half[0], -half[1], half[0], half[1])
    return translate(rotate(shape, yaw_rad, origin=(0, 0), use_radians=True), x, y)


@settings(max_examples=200, deadline=None)
@given(
    st.floats(-6.0, 6.0),
    st.floats(-6.0, 6.0),
    st.floats(-math.pi, math.pi),
    st.floats(-math.pi, math.pi),
)
def test_contacts_are_the_overlaps_and_pushing_by_the_depth_ends_them(
    x: float, y: float, yaw_a: float, yaw_b: float
) -> None:
    center, yaw = np.array([[0.0, 0.0, 0.0], [x, y, 0.0]]), np.array([yaw_a, yaw_b])
    overlap = footprint(0, 0, yaw_a, HALF[0]).intersection(footprint(x, y, yaw_b, HALF[1]))
    contacts = find_contacts(center, HALF, yaw, LEVEL)
    if overlap.area > 1e-6:
        (contact,) = contacts
        center[1, :2] += contact.normal * (contact.depth_m + 1e-9)
        assert find_contacts(center, HALF, yaw, LEVEL) == []
    elif overlap.is_empty:
        assert contacts == []


def two_cars(gap_m: float) -> VehicleFleet:
    fleet = VehicleFleet()
    parameters = catalogue()["vehicle.tesla.model3"].vehicle
    assert parameters is not None
    fleet.add(1, parameters, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    fleet.add(2, parameters, (2.0 * parameters.half_length_m + gap_m, 0.0, 0.0), (0.0, 0.0, 0.0))
    return fleet


def test_a_car_that_runs_into_a_parked_one_does_not_pass_it() -> None:
    fleet = two_cars(10.0)
    fleet.set_target_velocity(1, (15.0, 0.0, 0.0))
    fleet.set_control(1, VehicleControl(1.0, 0.0, 0.0, False, False))
    fleet.set_control(2, VehicleControl(0.0, 0.0, 1.0, True, False))
    half_length = catalogue()["vehicle.tesla.model3"].box_extent[0]
    for _ in range(100):
        fleet.step(0.05, 5)
        assert fleet.location[1, 0] - fleet.location[0, 0] >= 2.0 * half_length - 0.01
    assert abs(fleet.location[0, 1]) < 0.01


def test_a_rear_end_shares_the_momentum() -> None:
    fleet = two_cars(0.2)
    fleet.set_target_velocity(1, (10.0, 0.0, 0.0))
    for _ in range(4):
        fleet.step(0.05, 5)
    assert fleet.velocity[0, 0] == pytest.approx(5.0, abs=0.6)
    assert fleet.velocity[1, 0] == pytest.approx(5.0, abs=0.6)


def test_a_vehicle_without_physics_cannot_be_pushed() -> None:
    fleet = two_cars(1.0)
    fleet.set_simulate_physics(2, False)
    before = fleet.location[1].copy()
    fleet.set_target_velocity(1, (10.0, 0.0, 0.0))
    for _ in range(10):
        fleet.step(0.05, 5)
    np.testing.assert_array_equal(fleet.location[1], before)
    assert -1.0 < fleet.velocity[0, 0] <= 0.0  # it bounces off a little


def test_vehicles_whose_collisions_are_off_pass_through_each_other() -> None:
    fleet = two_cars(1.0)
    fleet.set_collides(1, False)
    fleet.set_target_velocity(1, (15.0, 0.0, 0.0))
    for _ in range(20):
        fleet.step(0.05, 5)
    assert fleet.location[0, 0] > fleet.location[1, 0]
    assert fleet.velocity[1, 0] == 0.0


def test_boxes_that_all_touch_are_all_found_in_order() -> None:
    count = 30  # more pairs than a list of so many boxes begins with
    center = np.zeros((count, 3))
    center[:, 0] = np.linspace(1.0, 0.0, count)
    contacts = find_contacts(
        center, np.tile(HALF[0], (count, 1)), np.zeros(count), np.tile(LEVEL[0], (count, 1))
    )
    pairs = [(contact.first, contact.second) for contact in contacts]
    assert pairs == [(i, j) for i in range(count) for j in range(i + 1, count)]
