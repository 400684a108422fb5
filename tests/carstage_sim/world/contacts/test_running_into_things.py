"""Walls stop cars, hits beside the middle turn them, and momentum goes somewhere."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps import Town
from carstage_sim.maps.ground import Ground
from carstage_sim.world.contacts.boxes import TOWN, find_contacts
from carstage_sim.world.contacts.impulses import Bodies, resolve
from carstage_sim.world.contacts.obstacles import Obstacles
from carstage_sim.world.mechanics import terrain_of
from plain_scenes import CAR, drive, fleet_on, one_car, parameters, plain, sheet, turned_deg, wall

NOSE_M = parameters().box_center_x_m + parameters().half_length_m


@settings(max_examples=15, deadline=None)
@given(
    st.floats(5.0, 40.0),
    st.floats(-60.0, 60.0),
    st.sampled_from([0.01, 0.05, 0.1]),
    st.floats(3.0, 8.0),
)
def test_nothing_gets_through_a_wall_at_40_m_s_in_steps_of_a_tenth(
    speed: float, yaw_deg: float, delta_s: float, gap_m: float
) -> None:
    fleet = one_car(plain(wall((20.0, -300.0), (20.0, 300.0))), at=(20.0 - gap_m, 0.0, 0.0))
    fleet.set_transform(CAR, (20.0 - gap_m, 0.0, 0.0), (0.0, yaw_deg, 0.0))
    yaw = math.radians(yaw_deg)
    fleet.set_target_velocity(CAR, (speed * math.cos(yaw), speed * math.sin(yaw), 0.0))
    met = False
    for _ in range(round(1.5 / delta_s)):
        fleet.step(delta_s, 1)
        met = met or bool(fleet.crashes.touches)
        assert fleet.location[0, 0] < 20.0 - 0.5
    if speed * math.cos(yaw) > 15.0:
        assert met


def test_a_wall_ahead_stops_a_car_and_takes_its_momentum() -> None:
    fleet = one_car(plain(wall((20.0, -5.0), (20.0, 5.0))), at=(10.0, 0.0, 0.0))
    fleet.set_target_velocity(CAR, (15.0, 0.0, 0.0))
    touches = []
    for _ in range(20):
        fleet.step(0.05, 5)
        touches += fleet.crashes.touches
    assert fleet.location[0, 0] + NOSE_M <= 20.0 + 1e-6
    assert abs(fleet.speed[0]) < 1.5
    assert {touch.second for touch in touches} == {TOWN}
    assert {touch.label for touch in touches} == {CityObjectLabel.WALLS}
    given = sum(touch.impulse[0] for touch in touches)
    assert given == pytest.approx(15.0 * parameters().mass_kg, rel=0.25)
    assert turned_deg(fleet) < 1.0


def test_a_hit_beside_the_middle_turns_the_car_towards_the_obstacle() -> None:
    pole = wall((20.0, 0.5), (20.0, 0.9))
    fleet = one_car(plain(pole), at=(10.0, 0.0, 0.0))
    fleet.set_target_velocity(CAR, (12.0, 0.0, 0.0))
    drive(fleet, 1.0)
    assert math.remainder(float(fleet.rotation_deg[0, 1]), 360.0) > 3.0


def test_a_car_that_scrapes_along_a_wall_of_many_pieces_goes_on() -> None:
    pieces = [wall((x, 1.3), (x + 1.0, 1.3), object_id=1) for x in range(60)]
    fleet = one_car(plain(*pieces), at=(2.0, 0.0, 0.0))
    fleet.set_transform(CAR, (5.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    fleet.set_target_velocity(CAR, (12.0, 0.8, 0.0))
    touched = False
    for _ in range(30):
        fleet.step(0.05, 5)
        touched = touched or bool(fleet.crashes.touches)
    assert touched
    assert fleet.location[0, 0] > 12.0
    assert fleet.location[0, 1] < 1.3


def test_what_clients_took_away_stops_nobody() -> None:
    mesh = plain(wall((20.0, -5.0), (20.0, 5.0), object_id=3))
    obstacles = Obstacles(mesh, Ground(mesh))
    box = np.array([[19.0, 0.0, 0.0]]), np.array([[2.0, 1.0]]), np.zeros(1)
    rows = np.zeros(1, np.int64)
    assert len(obstacles.contacts(rows, *box)) == 1
    obstacles.hide(frozenset({3}))
    assert obstacles.contacts(rows, *box) == []
    obstacles.hide(frozenset())
    assert len(obstacles.contacts(rows, *box)) == 1


def test_a_rail_on_a_bridge_stops_nobody_below() -> None:
    roadway = sheet((-500.0, -6.0), (500.0, 6.0), lambda _x, _y: 6.0)
    mesh = plain(roadway, wall((20.0, -5.0), (20.0, 5.0), base_m=6.0))
    below = one_car(mesh, at=(10.0, 0.0, 0.0))
    above = one_car(mesh, at=(10.0, 0.0, 6.0))
    for fleet in (below, above):
        fleet.set_target_velocity(CAR, (15.0, 0.0, 0.0))
        drive(fleet, 2.0)
    assert below.location[0, 0] > 30.0
    assert above.location[0, 0] + NOSE_M <= 20.0 + 1e-6
    assert above.location[0, 2] == pytest.approx(6.0, abs=1e-3)


def test_no_lane_of_the_town_is_barred(stage01: Town) -> None:
    lanes, obstacles = stage01.lanes, terrain_of(stage01).obstacles
    rows = np.arange(len(lanes.location))
    half_size = np.tile([1.0, 0.9], (len(rows), 1))
    yaw = np.radians(lanes.rotation_deg[:, 1])
    barred = obstacles.contacts(rows, lanes.location, half_size, yaw)
    assert [lanes.location[contact.first].tolist() for contact in barred] == []


def test_buildings_trunks_and_poles_of_the_town_are_obstacles(stage01: Town) -> None:
    found = set(terrain_of(stage01).obstacles.label.tolist())
    wanted = {CityObjectLabel.BUILDINGS, CityObjectLabel.VEGETATION, CityObjectLabel.POLES}
    assert wanted <= found


body = st.tuples(
    st.floats(-2.0, 2.0),
    st.floats(-2.0, 2.0),
    st.floats(-math.pi, math.pi),
    st.floats(-20.0, 20.0),
    st.floats(-20.0, 20.0),
    st.floats(-2.0, 2.0),
    st.floats(100.0, 9000.0),
)


@settings(max_examples=80, deadline=None)
@given(body, body)
def test_collisions_keep_momentum_and_never_add_energy(a: tuple, b: tuple) -> None:  # type: ignore[type-arg]
    rows = np.array([a, b])
    mass = rows[:, 6]
    half_size = np.array([[2.3, 0.9], [2.0, 1.0]])
    inertia = mass * (half_size**2).sum(axis=1) / 3.0
    center = np.column_stack([rows[:, :2], np.zeros(2)])
    bodies = Bodies(
        center, half_size, rows[:, 2], rows[:, 3:5].copy(), rows[:, 5].copy(), 1 / mass, 1 / inertia
    )
    contacts = find_contacts(center, half_size, rows[:, 2], np.tile((0.15, 1.5), (2, 1)))

    def momentum() -> np.ndarray:
        return (mass[:, None] * bodies.velocity).sum(axis=0)

    def energy() -> float:
        return float(
            (mass * (bodies.velocity**2).sum(axis=1)).sum() + (inertia * bodies.spin**2).sum()
        )

    before = momentum(), energy()
    impulses = resolve(contacts, bodies)
    np.testing.assert_allclose(momentum(), before[0], atol=1e-6 * mass.sum())
    assert energy() <= before[1] * (1.0 + 1e-9) + 1e-6
    for contact, impulse in zip(contacts, impulses, strict=True):
        assert impulse @ contact.normal >= -1e-6


def test_a_shunted_car_slides_and_its_tyres_bring_it_to_rest() -> None:
    fleet = fleet_on(plain())
    fleet.add(1, parameters(), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    fleet.add(2, parameters(), (12.0, 0.0, 0.0), (0.0, 90.0, 0.0))
    fleet.step(0.05, 5)
    fleet.set_target_velocity(1, (12.0, 0.0, 0.0))
    speeds = []
    for _ in range(70):
        fleet.step(0.05, 5)
        speeds.append(float(fleet.velocity[1, 0]))
    assert max(speeds) > 3.0
    assert speeds[-1] == pytest.approx(0.0, abs=1e-6)
    assert fleet.location[1, 0] > 12.5
