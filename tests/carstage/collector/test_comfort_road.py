"""The road that the Traffic Manager will take, as it is read from the map, and who is on it."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from carstage.collector.comfort.road import SPACING_M, RoadAhead, StopLines
from carstage.collector.comfort.road_users import RoadUsers


def spot(x: float, y: float) -> Any:
    return SimpleNamespace(x=x, y=y)


class Lane:
    """A straight lane of 40 m, then a left and a right one of 10 m radius."""

    def __init__(self, road_id: int = 1, s: float = 0.0) -> None:
        self.road_id, self.lane_id, self.s = road_id, -1, s
        side = {1: 0.0, 2: -1.0, 3: 1.0}[road_id]
        turned = s / 10.0 if side else 0.0
        x = 40.0 + 10.0 * math.sin(turned) if side else s
        y = side * 10.0 * (1.0 - math.cos(turned))
        rotation = SimpleNamespace(yaw=side * math.degrees(turned))
        self.transform = SimpleNamespace(location=spot(x, y), rotation=rotation)

    def next(self, distance_m: float) -> list[Lane]:
        left_m = (40.0 if self.road_id == 1 else 15.0) - self.s
        if left_m >= distance_m:
            return [Lane(self.road_id, self.s + distance_m)]
        return [Lane(road, distance_m - left_m) for road in (2, 3)] if self.road_id == 1 else []

    def get_landmarks(self, within_m: float, stop_at_junction: bool) -> list[Any]:
        marks = [("1000001", 38.0, 0.0), ("274", 30.0, 30.0), ("1000011", 20.0, 0.0)]
        return [
            SimpleNamespace(type=kind, value=value, waypoint=Lane(1, s))
            for kind, s, value in marks
            if self.s < s < self.s + within_m and not stop_at_junction
        ]


class Map:
    def get_waypoint(self, place: Any) -> Lane:
        return Lane(1, place.x)


class Light:
    def __init__(self, number: int, line: Lane) -> None:
        self.id, self.line = number, line

    def get_stop_waypoints(self) -> list[Lane]:
        return [self.line]


def road(*lights: Light) -> RoadAhead:
    ahead = RoadAhead(Map(), StopLines(lights))
    ahead.begin(spot(1.0, 0.0))
    return ahead


def test_the_road_ends_at_a_fork_until_the_way_is_known() -> None:
    ahead = road()
    ahead.reach(())
    assert ahead.forks
    assert ahead.places[-1].x == pytest.approx(39.0)
    ahead.reach(((3, -1),))
    assert not ahead.forks
    assert ahead.places[-1].y > 5.0


def test_curvature_is_that_of_the_map() -> None:
    ahead = road()
    ahead.reach(((2, -1),))
    assert [place.curvature for place in ahead.places[:15]] == [0.0] * 15
    assert ahead.places[-1].curvature == pytest.approx(0.1, rel=0.02)
    bends = ahead.bends_and_lights(100.0)
    assert [ahead.places[number].curvature > 0.05 for number in bends] == [True] * len(bends)
    assert bends[0] == 20
    assert not ahead.bends_and_lights(30.0)


def test_distances_do_not_jump_from_place_to_place() -> None:
    ahead = road()
    ahead.reach(())
    for step in range(60):
        x = 1.0 + 0.3 * step
        assert ahead.follow(x, 0.2)
        assert ahead.distance_m(15) == pytest.approx(31.0 - x)
        assert ahead.gap_m(35.0, 0.5, 17) == pytest.approx(35.0 - x)
    assert not ahead.follow(x, 3.0)


def test_a_light_stops_at_its_line_only_and_only_its_lane() -> None:
    light, other = Light(7, Lane(1, 36.0)), Light(8, Lane(2, 3.0))
    ahead = road(light, other)
    ahead.reach(((3, -1),))
    lines = [place for place in ahead.places if place.light is not None]
    assert {line.light for line in lines} == {light}
    assert all(abs(line.x - 36.0) <= SPACING_M / 2.0 + 0.1 for line in lines)


def test_signs_are_those_that_the_traffic_manager_slows_down_for() -> None:
    ahead = road()
    assert sorted(ahead.signs(60.0)) == [
        (30.0, 0.0, pytest.approx(30.0 / 3.6)),
        (38.0, 0.0, pytest.approx(15.0 / 3.6)),
    ]


class Snapshot(dict):  # type: ignore[type-arg]
    """Places by actor id, as ``carla.WorldSnapshot``."""

    def __iter__(self) -> Any:
        return iter([SimpleNamespace(id=number) for number in self.keys()])

    def find(self, number: int) -> Any:
        if number not in self:
            return None
        place = spot(*self[number])
        return SimpleNamespace(get_transform=lambda: SimpleNamespace(location=place))


class World:
    """Knows kinds of actors by id; counts how often it is asked."""

    def __init__(self, kinds: dict[int, str]) -> None:
        self.kinds, self.asked = kinds, 0

    def get_actors(self, numbers: list[int]) -> list[Any]:
        self.asked += 1
        extent = SimpleNamespace(x=2.5)
        box = SimpleNamespace(extent=extent)
        return [SimpleNamespace(id=n, type_id=self.kinds[n], bounding_box=box) for n in numbers]


def test_road_users_are_vehicles_and_walkers_also_later_ones() -> None:
    world = World({1: "vehicle.a", 2: "sensor.b", 3: "walker.c", 4: "vehicle.d", 5: "vehicle.e"})
    users = RoadUsers(world)
    snapshot = Snapshot({1: (0.0, 0.0), 2: (1.0, 0.0), 3: (5.0, 0.0), 4: (50.0, 0.0)})
    for _ in range(3):
        near = users.near(snapshot, 0.0, 0.0, 20.0, but=1)
        assert [user.id for user in near] == [3]
    assert world.asked == 1
    snapshot[5] = (3.0, 0.0)
    del snapshot[3]
    assert [user.id for user in users.near(snapshot, 0.0, 0.0, 20.0, but=1)] == [5]
