"""Pedestrians wait for lights, look before they step out, and begin where the ego sees them."""

from __future__ import annotations

import random
from types import SimpleNamespace
from typing import Any

import carla
import pytest

from carstage.collector import pedestrian_rules
from carstage.collector.actors import Walker
from carstage.collector.crosswalks import Crosswalk, crossing_ways, outlines
from carstage.collector.pedestrian_rules import Moving, PedestrianRules, is_free

SPEED_M_S = 1.4
GREEN, RED, YELLOW, OFF = (
    getattr(carla.TrafficLightState, name) for name in ("Green", "Red", "Yellow", "Off")
)


class Light:
    """What a rule asks of a traffic light."""

    def __init__(self, state: carla.TrafficLightState) -> None:
        self._state = state

    def get_state(self) -> carla.TrafficLightState:
        return self._state


def crosswalk(*states: carla.TrafficLightState, x: float = 0.0) -> Crosswalk:
    """Over a road along x, 8 m long; vehicles with lights come along +x."""
    # Along the road is -x for a crosswalk whose way over it is +y.
    lights = tuple(Light(state) for state in states)
    return Crosswalk((x, 0.0), 0.0, (0.0, 1.0), 4.0, 1.75, lights, -1.0 if lights else 0.0)


@pytest.mark.parametrize("state", [GREEN, YELLOW])
def test_nobody_steps_out_while_vehicles_have_the_light(state: carla.TrafficLightState) -> None:
    assert not is_free(crosswalk(state), [], SPEED_M_S, 0.0)
    assert not is_free(crosswalk(RED, state), [], SPEED_M_S, 60.0)
    assert not is_free(crosswalk(state), [], SPEED_M_S, 0.0, goes=True)


@pytest.mark.parametrize("states", [(), (RED,), (OFF,)])
def test_an_empty_road_may_be_crossed(states: tuple[carla.TrafficLightState, ...]) -> None:
    assert is_free(crosswalk(*states), [], SPEED_M_S, 0.0)


@pytest.mark.parametrize(
    ("vehicle", "free"),
    [
        (Moving(-30.0, 1.7, 10.0, 0.0), False),  # comes
        (Moving(-69.0, 1.7, 8.0, 0.0), True),  # comes, from so far that there is time
        (Moving(30.0, 1.7, 10.0, 0.0), True),  # goes away
        (Moving(-30.0, 1.7, 0.0, 0.0), True),  # stands
        (Moving(-30.0, 40.0, 10.0, 0.0), True),  # on another street
        (Moving(-3.0, 0.0, 3.0, 0.0), False),  # almost on it
    ],
)
def test_who_steps_out_has_looked(vehicle: Moving, free: bool) -> None:
    assert is_free(crosswalk(), [vehicle], SPEED_M_S, 0.0) is free


def test_a_vehicle_that_will_stop_at_its_red_light_is_not_waited_for() -> None:
    comes = Moving(-30.0, 1.7, 8.0, 0.0)
    too_fast = Moving(-15.0, 1.7, 14.0, 0.0)
    leaves_the_junction = Moving(30.0, -1.7, -8.0, 0.0)
    assert is_free(crosswalk(RED), [comes], SPEED_M_S, 0.0)
    assert not is_free(crosswalk(), [comes], SPEED_M_S, 0.0)
    assert not is_free(crosswalk(RED), [too_fast], SPEED_M_S, 0.0)
    assert not is_free(crosswalk(RED), [leaves_the_junction], SPEED_M_S, 0.0)


def test_who_has_waited_long_takes_a_smaller_gap() -> None:
    five_s_away = [Moving(-54.25, 1.7, 10.0, 0.0)]
    assert not is_free(crosswalk(), five_s_away, SPEED_M_S, 1.0)
    assert is_free(crosswalk(), five_s_away, SPEED_M_S, 10.0)


def test_outlines_end_with_their_first_corner() -> None:
    corners = [(0, 0), (4, 0), (4, 8), (0, 8), (0, 0), (20, 0), (24, 0), (24, 8), (20, 0)]
    found = outlines([carla.Location(float(x), float(y), 0.0) for x, y in corners])
    assert [[(corner.x, corner.y) for corner in outline] for outline in found] == [
        [(0, 0), (4, 0), (4, 8), (0, 8)],
        [(20, 0), (24, 0), (24, 8)],
    ]


@pytest.mark.parametrize("closed", [(), (0,), (1,), (2,), (0, 2), (0, 1)])
def test_outlines_that_do_not_repeat_their_first_corner_end_too(closed: tuple[int, ...]) -> None:
    walks = [[(x, 0), (x + 4, 0), (x + 4, 8), (x, 8)] for x in (0, 20, 40)]
    given = [[*walk, walk[0]] if n in closed else walk for n, walk in enumerate(walks)]
    corners = [carla.Location(float(x), float(y), 0.0) for walk in given for x, y in walk]
    found = outlines(corners)
    assert [[(corner.x, corner.y) for corner in outline] for outline in found] == walks


def test_corners_that_cannot_be_told_apart_are_no_crosswalk() -> None:
    closed = [(0, 0), (4, 0), (4, 8), (0, 0)]
    of_six, of_nine = ([(20 + 2 * k, 7 * (k % 2)) for k in range(n)] for n in (6, 9))
    for lost, kept in ((of_nine, []), (of_six, [of_six])):
        corners = [carla.Location(float(x), float(y), 0.0) for x, y in (*lost, *closed)]
        found = [[(corner.x, corner.y) for corner in outline] for outline in outlines(corners)]
        assert found == [*kept, closed[:3]]


def test_ways_lead_over_crosswalks_before_the_ego() -> None:
    start = carla.Transform(carla.Location(-30.0, 2.0, 0.0), carla.Rotation(0.0, 0.0, 0.0))
    before, behind, far = crosswalk(x=0.0), crosswalk(x=-50.0), crosswalk(x=500.0)
    rng = random.Random(1)
    places = [
        carla.Location(x + rng.uniform(-10.0, 10.0), side * rng.uniform(5.0, 7.0), 0.0)
        for x in (0.0, -50.0, 500.0)
        for side in (1.0, -1.0)
        for _ in range(20)
    ]
    ways = list(crossing_ways([far, behind, before], places, start, random.Random(2)))
    assert len(ways) >= 8
    assert all(abs(begin.x) <= 10.0 and begin.y * end.y < 0.0 for begin, end in ways)
    assert len({(begin.x, begin.y) for begin, _ in ways}) == len(ways)
    again = list(crossing_ways([far, behind, before], places, start, random.Random(2)))
    assert [(a.x, b.x) for a, b in ways] == [(a.x, b.x) for a, b in again]


def test_there_is_no_way_where_no_crosswalk_is_near() -> None:
    start = carla.Transform(carla.Location(0.0, 0.0, 0.0))
    places = [carla.Location(500.0, side * 5.0, 0.0) for side in (1.0, -1.0)]
    assert not list(crossing_ways([crosswalk(x=500.0)], places, start, random.Random(1)))


class _Street:
    """A crosswalk, one pedestrian and perhaps a vehicle that comes, as the client has them."""

    def __init__(self) -> None:
        self.place, self.moves = (0.0, -4.5), (0.0, 1.4)
        self.comes = False
        self.speeds: list[float] = []
        self.sent: list[Any] = []
        self.world = self.map = self
        self.id = 1
        self.target = carla.Location(0.0, 6.0, 0.0)

    def walker(self) -> Walker:
        controller = SimpleNamespace(
            set_max_speed=self.speeds.append, go_to_location=self.sent.append
        )
        return Walker(self, controller, SPEED_M_S, self.target)

    def get_actors(self) -> Any:
        vehicles = [SimpleNamespace(id=2)] if self.comes else []
        return SimpleNamespace(filter=lambda kind: vehicles if "vehicle" in kind else [])

    def get_snapshot(self) -> Any:
        return self

    def find(self, number: int) -> Any:
        place, moves = (self.place, self.moves) if number == 1 else ((-10.0, 1.7), (10.0, 0.0))
        return SimpleNamespace(
            get_transform=lambda: carla.Transform(carla.Location(*place, 0.0)),
            get_velocity=lambda: carla.Vector3D(*moves, 0.0),
        )

    def wait_and_go(self, rules: PedestrianRules) -> None:
        for self.comes in (True, False):
            rules.before_step()


def test_who_has_arrived_is_not_sent_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pedestrian_rules, "crosswalks", lambda *_: [crosswalk()])
    street: Any = _Street()
    rules = PedestrianRules(street, [street.walker()], 0.1)
    street.wait_and_go(rules)
    assert street.speeds == [0.0, SPEED_M_S]
    assert street.sent == [street.target]
    street.place = (0.0, 5.9)
    rules.before_step()
    street.place, street.moves = (0.0, 4.5), (0.0, -1.4)
    street.wait_and_go(rules)
    assert street.speeds == [0.0, SPEED_M_S] * 2
    assert street.sent == [street.target]
