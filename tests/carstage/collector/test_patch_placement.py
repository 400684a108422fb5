"""Where boards of patches and those who carry them are put, on a map of a built-in town."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import carla
import pytest

from carstage.collector.actors import Walker
from carstage.collector.patch_carriers import (
    beyond_road,
    large_vehicles,
    place_carriers,
    places_ahead,
    send_to_ego,
    to_side,
)
from carstage.collector.patches import BESIDE_M, RECESS_M, _foremost
from carstage.collector.scenario import Population
from carstage.spec.patches import PERSON, VEHICLE_REAR, PatchPicture, PatchSpec
from carstage_sim.maps.writer import PLANS, opendrive_of


@pytest.fixture(scope="module")
def town() -> Any:
    return carla.Map("Stage01", opendrive_of(PLANS["Stage01"]))


class Actor(SimpleNamespace):
    """Stands somewhere, and may be put elsewhere."""

    def __init__(self, number: int, at: Any, extent: tuple[float, float, float]) -> None:
        box = carla.BoundingBox(carla.Location(0.0, 0.0, extent[2]), carla.Vector3D(*extent))
        super().__init__(id=number, bounding_box=box, transform=at)

    def get_location(self) -> Any:
        return self.transform.location

    def set_transform(self, transform: Any) -> None:
        self.transform = transform


DRIVEN = (carla.LaneType.Driving, carla.LaneType.Parking, carla.LaneType.Biking)
LORRY, CAR, PERSON_SIZE = (4.0, 1.3, 1.6), (2.3, 1.0, 0.75), (0.3, 0.3, 0.9)


def start_of(town: Any) -> Any:
    """A place with 30 m of a straight lane ahead, and a sidewalk to the right."""
    session: Any = SimpleNamespace(map=town)
    for place in town.generate_waypoints(15.0):
        ways = [place.next(ahead) for ahead in (10.0, 20.0, 30.0)]
        if any(not way or way[0].is_junction for way in ways) or place.is_junction:
            continue
        away_m, sidewalk = beyond_road(session, ways[0][0], "right")
        ahead = ways[2][0].transform.location - place.transform.location
        forward = place.transform.get_forward_vector()
        if abs(ahead.x * forward.y - ahead.y * forward.x) > 1.0:
            continue
        if sidewalk is not None and away_m < 12.0:
            return place
    raise AssertionError("no such place")


def patch(target: str, distance_m: float, name: str = "patch0") -> PatchSpec:
    picture = PatchPicture(4, 3, "")
    return PatchSpec(name, target, picture, 0.6, (0.5, 0.5), "", distance_m, "right")


def parked_at(transform: Any) -> Any:
    """A car of the level, whose box is in world coordinates."""
    box = carla.BoundingBox(transform.location, carla.Vector3D(*CAR))
    box.rotation = transform.rotation
    return SimpleNamespace(bounding_box=box)


class Level(SimpleNamespace):
    """A world with cars that are no actors."""

    def get_environment_objects(self, label: Any) -> list[Any]:
        return self.parked if label == carla.CityObjectLabel.Car else []


def scene(
    town: Any, others: list[Actor], walkers: list[Actor], parked: list[Any] | None = None
) -> tuple[Any, Population, Any]:
    start = start_of(town)
    ego = Actor(1, start.transform, CAR)
    people: Any = [SimpleNamespace(actor=walker) for walker in walkers]
    session = SimpleNamespace(map=town, world=Level(parked=parked or []))
    return session, Population(ego, [*others], people, {}, {}), start


def put(
    town: Any,
    patches: list[PatchSpec],
    others: list[Actor],
    walkers: list[Actor],
    parked: list[Any] | None = None,
) -> Any:
    session, population, start = scene(town, others, walkers, parked)
    return place_carriers(session, SimpleNamespace(patches=patches), population), start  # type: ignore[arg-type]


def far() -> Any:
    return carla.Transform(carla.Location(900.0, 900.0, 0.0))


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_billboard_beside_a_road_stands_on_no_lane_that_is_driven_on(
    town: Any, side: str
) -> None:
    """Between two lanes the client's map may know none: that is not the road's edge."""
    session: Any = SimpleNamespace(map=town)
    for place in town.generate_waypoints(12.0):
        if place.is_junction:
            continue
        away_m, _ = beyond_road(session, place, side)
        at, (x, y) = place.transform.location, to_side(place.transform, side)
        for more_m in (0.0, BESIDE_M, BESIDE_M + 0.5):
            spot = carla.Location(at.x + x * (away_m + more_m), at.y + y * (away_m + more_m), at.z)
            lane = town.get_waypoint(spot, False, carla.LaneType.Any)
            assert lane is None or lane.lane_type not in DRIVEN


def test_a_lorry_s_rear_is_put_ahead_of_the_ego(town: Any) -> None:
    lorry, car = Actor(2, far(), LORRY), Actor(3, far(), CAR)
    carriers, start = put(town, [patch(VEHICLE_REAR, 15.0)], [car, lorry], [])
    assert carriers == {"patch0": lorry}
    forward = start.transform.get_forward_vector()
    away = lorry.get_location() - start.transform.location
    rear_m = away.x * forward.x + away.y * forward.y - LORRY[0]
    assert rear_m == pytest.approx(15.0, abs=1.0)
    assert car.get_location().x == 900.0


def test_a_lorry_is_put_into_no_parked_car_of_the_level(town: Any) -> None:
    """One beside the lane is no hindrance, one in the way is."""
    start = start_of(town)
    wanted = start.next(15.0 + LORRY[0])[0].transform
    right = wanted.get_right_vector()
    for across_m, hinders in ((1.0, True), (3.0, False)):
        middle = carla.Location(
            wanted.location.x + across_m * right.x, wanted.location.y + across_m * right.y, 0.0
        )
        parked = parked_at(carla.Transform(middle, wanted.rotation))
        lorry = Actor(2, far(), LORRY)
        carriers, _ = put(town, [patch(VEHICLE_REAR, 15.0)], [lorry], [], [parked])
        assert carriers == {"patch0": lorry}
        moved_m = lorry.get_location().distance(wanted.location)
        assert (moved_m > 1.0) is hinders
        away = lorry.get_location() - middle
        ahead, side = (
            abs(away.x * axis.x + away.y * axis.y) for axis in (wanted.get_forward_vector(), right)
        )
        assert ahead > LORRY[0] + CAR[0] or side > LORRY[1] + CAR[1]


def test_nobody_is_put_where_somebody_is_or_behind_another(town: Any) -> None:
    """A car 8 m ahead hides what is farther along the lane; the lane beside it is free."""
    start = start_of(town)
    blocking = Actor(3, start.next(8.0)[0].transform, CAR)
    lorry = Actor(2, far(), LORRY)
    carriers, _ = put(town, [patch(VEHICLE_REAR, 15.0)], [blocking, lorry], [])
    if carriers:
        across = lorry.get_location().distance(blocking.get_location())
        lane = town.get_waypoint(lorry.get_location())
        assert across > LORRY[0] + CAR[0]
        assert (lane.road_id, lane.lane_id) != (start.road_id, start.lane_id)
    else:
        assert lorry.get_location().x == 900.0


def test_a_person_is_put_on_the_sidewalk_and_looks_at_the_ego(town: Any) -> None:
    person = Actor(2, far(), PERSON_SIZE)
    carriers, start = put(town, [patch(PERSON, 12.0)], [], [person])
    assert carriers == {"patch0": person}
    lane = town.get_waypoint(person.get_location(), False, carla.LaneType.Any)
    assert lane.lane_type == carla.LaneType.Sidewalk
    back, forward = (one.get_forward_vector() for one in (person.transform, start.transform))
    assert back.x * forward.x + back.y * forward.y < -0.9


def test_a_person_with_a_patch_has_the_ego_as_its_target(town: Any) -> None:
    person, other = Actor(2, far(), PERSON_SIZE), Actor(3, far(), PERSON_SIZE)
    sent: list[Any] = []
    controller = SimpleNamespace(go_to_location=sent.append)
    elsewhere = carla.Location(500.0, 500.0, 0.0)
    session, population, start = scene(town, [], [])
    population.walkers.extend(Walker(one, controller, 1.4, elsewhere) for one in (person, other))
    patches: Any = SimpleNamespace(patches=[patch(PERSON, 12.0)])
    carriers = place_carriers(session, patches, population)
    carrying, walking = send_to_ego(session, population, carriers)
    assert [carrying.target] == sent
    assert carrying.target.distance(start.transform.location) < 15.0
    assert walking.target is elsewhere


def test_everybody_carries_one_patch_and_who_finds_none_stays(town: Any) -> None:
    people = [Actor(2, far(), PERSON_SIZE)]
    patches = [patch(PERSON, 12.0), patch(PERSON, 14.0, "patch1"), patch(VEHICLE_REAR, 9.0, "p")]
    carriers, _ = put(town, patches, [Actor(3, far(), CAR)], people)
    assert carriers == {"patch0": people[0]}


def test_only_large_vehicles_carry_boards(town: Any) -> None:
    _, population, _ = scene(town, [Actor(2, far(), CAR), Actor(3, far(), LORRY)], [])
    assert [vehicle.id for vehicle in large_vehicles(population)] == [3]


def test_places_ahead_begin_at_the_wanted_distance(town: Any) -> None:
    start = start_of(town)
    found = [start.transform.location.distance(p.transform.location)
             for p in places_ahead(start, 20.0)]  # fmt: skip
    assert found[:3] == pytest.approx([20.0, 22.0, 18.0], abs=0.5)
    assert all(start.transform.location.distance(p.transform.location) > 0.0
               for p in places_ahead(start, 1.0))  # fmt: skip


def test_a_board_hangs_before_what_is_foremost_of_a_wall() -> None:
    flat = [(along, 8.0) for along in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    assert _foremost(flat) == pytest.approx((8.0, 0.0))
    window = [(a, 8.2 if abs(a) > 0.7 else 8.0) for a, _ in flat]
    found = _foremost(window)
    assert found is not None
    assert all(found[0] + found[1] * a <= away + 1e-6 for a, away in window)
    assert found[0] == pytest.approx(8.0)
    slanted = [(a, 8.0 + 0.5 * a) for a, _ in flat]
    assert _foremost(slanted) == pytest.approx((8.0, 0.5))


def test_a_corner_and_a_steep_wall_take_no_board() -> None:
    corner = [(a, 8.0 if a < 0.3 else 8.0 + 2.0 * RECESS_M) for a in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    assert _foremost(corner) is None
    assert _foremost([(a, 8.0 + 2.0 * a) for a in (-1.0, 0.0, 1.0)]) is None
