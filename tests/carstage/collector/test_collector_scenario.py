"""Personalities, ways by road, and what carries a sensor."""

from __future__ import annotations

import random
from types import SimpleNamespace
from typing import Any, cast

import pytest

pytest.importorskip("carla")

import carla

import small_maps
from carstage.collector.internals.errors import SceneError
from carstage.collector.scenario.autopilot import places_of
from carstage.collector.scenario.routing import RoadGraph
from carstage.collector.scenario.traffic import LAW_ABIDING, personality
from carstage.collector.sensors.carriers import Carriers
from carstage.spec import Place, PoseSpec, RouteSpec, SensorSpec, TrafficSpec


class Spot:
    """A ``carla.Location`` of the flat world."""

    def __init__(self, x: float, y: float = 0.0) -> None:
        self.x, self.y, self.z = x, y, 0.0

    def distance(self, other: Spot) -> float:
        return ((self.x - other.x) ** 2 + (self.y - other.y) ** 2) ** 0.5


def test_a_place_of_a_route_is_on_the_road_that_is_nearest_in_the_plane() -> None:
    """Not on a lower one beside it."""
    bridge = small_maps.road(1, 0, 0, 0, 100, elevation=((0, 12, 0, 0, 0),))
    below = small_maps.road(2, 0, 9, 0, 100)
    world_map = carla.Map("x", small_maps.document(bridge, below))
    route = RouteSpec((Place(50.0, 1.75), Place(50.0, -10.75)))
    session: Any = SimpleNamespace(map=world_map)
    found = places_of(session, cast("Any", SimpleNamespace(scenario=route, map="x")))
    roads = [world_map.get_waypoint(place).road_id for place in found]
    assert list(zip(roads, [round(place.z) for place in found], strict=True)) == [(1, 12), (2, 0)]


def traffic(**spreads: tuple[float, float]) -> TrafficSpec:
    return TrafficSpec(**spreads)


def test_nobody_breaks_the_law_unless_asked_to() -> None:
    values = personality(traffic(distance_m=(2.0, 2.0)), random.Random(1))
    assert values == {**LAW_ABIDING, "distance_m": 2.0}
    assert set(LAW_ABIDING.values()) == {0.0}


def test_each_vehicle_draws_its_own_value_within_the_spread() -> None:
    rng = random.Random(1)
    asked = traffic(speed_difference_percent=(-10.0, 30.0))
    drawn = [personality(asked, rng)["speed_difference_percent"] for _ in range(50)]
    assert len(set(drawn)) == 50
    assert -10.0 <= min(drawn) < 0.0 < 20.0 < max(drawn) <= 30.0


class Lane:
    """A straight lane of a map, ``(x0, y) .. (x1, y)``, and a waypoint at its begin."""

    def __init__(self, number: int, begin: Spot, end: Spot) -> None:
        self.road_id, self.section_id, self.lane_id = number, 0, -1
        self.is_junction = number == 2
        self.begin, self.end = begin, end
        self.transform = SimpleNamespace(location=begin)

    def next_until_lane_end(self, spacing_m: float) -> list[Any]:
        count = max(1, round(self.begin.distance(self.end) / spacing_m))
        return [
            SimpleNamespace(
                transform=SimpleNamespace(
                    location=Spot(
                        self.begin.x + (self.end.x - self.begin.x) * i / count,
                        self.begin.y + (self.end.y - self.begin.y) * i / count,
                    )
                )
            )
            for i in range(1, count + 1)
        ]


class Town:
    """A short way and a detour from lane 1 to lane 4; lane 5 leads nowhere back."""

    def __init__(self) -> None:
        a, b, c, d = Spot(0), Spot(40), Spot(80), Spot(120)
        detour = Spot(60, 50)
        self.lanes = {
            1: Lane(1, a, b),
            2: Lane(2, b, c),
            3: Lane(3, b, detour),
            6: Lane(6, detour, c),
            4: Lane(4, c, d),
            5: Lane(5, Spot(0, 500), Spot(40, 500)),
        }
        self.follow = [(1, 3), (1, 2), (2, 4), (3, 6), (6, 4), (5, 1)]

    def get_topology(self) -> list[tuple[Lane, Lane]]:
        return [(self.lanes[a], self.lanes[b]) for a, b in self.follow] + [
            (self.lanes[4], self.lanes[4])
        ]

    def get_waypoint(self, place: Spot) -> Lane:
        middles = {
            number: Spot((lane.begin.x + lane.end.x) / 2, (lane.begin.y + lane.end.y) / 2)
            for number, lane in self.lanes.items()
        }
        return self.lanes[min(middles, key=lambda number: middles[number].distance(place))]


def test_the_way_is_the_shortest_one() -> None:
    way = RoadGraph(Town()).way(Spot(8), Spot(112))
    assert way is not None
    assert [(place.x, place.y) for place in way] == [(112, 0.0)]


def test_each_lane_behind_a_junction_is_marked_near_its_begin_and_no_place_within_one() -> None:
    way = RoadGraph(Town()).way(Spot(8, 500), Spot(112))
    assert way is not None
    assert [(place.x, place.y) for place in way] == [(4.0, 0.0), (112, 0.0)]


def test_a_way_within_one_lane_stays_there() -> None:
    way = RoadGraph(Town()).way(Spot(8), Spot(32))
    assert way is not None
    assert [place.x for place in way] == [32]


def test_where_no_road_leads_there_is_no_way() -> None:
    assert RoadGraph(Town()).way(Spot(8), Spot(20, 500)) is None


def sensor(attach_to: str, index: int = 0) -> SensorSpec:
    pose = PoseSpec(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return SensorSpec("CAM", "rgb", "sensor.camera.rgb", False, False, pose, {}, attach_to, index)


def actor(actor_id: int, x: float) -> Any:
    transform = SimpleNamespace(location=Spot(x))
    return SimpleNamespace(id=actor_id, get_transform=lambda: transform)


def test_a_pattern_means_the_nearest_actor_that_is_not_the_ego() -> None:
    ego, others = actor(1, 0.0), [actor(4, 30.0), actor(3, -10.0), actor(2, 10.0)]
    found = SimpleNamespace(filter=lambda pattern: [ego, *others])
    carriers = Carriers(SimpleNamespace(get_actors=lambda: found), ego)
    ids = [carriers.carrier_of(sensor("vehicle.*", i), "sensors[0]").id for i in range(3)]
    assert ids == [2, 3, 4]
    assert carriers.carrier_of(sensor("ego"), "sensors[0]") is ego
    assert carriers.carrier_of(sensor("world"), "sensors[0]") is None
    with pytest.raises(SceneError, match=r"sensors\[2\].attach_to: 3 actors match"):
        carriers.carrier_of(sensor("vehicle.*", 3), "sensors[2]")
