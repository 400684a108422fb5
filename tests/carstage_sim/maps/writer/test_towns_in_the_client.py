"""What the real client makes of the built-in towns' OpenDRIVE texts."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

import carla
import pytest

from carstage_sim.maps.writer import PLANS, opendrive_of
from carstage_sim.maps.writer.layout import build_network
from carstage_sim.maps.writer.network import LaneKind, RoadNetwork

pytestmark = pytest.mark.xdist_group("towns in the client")  # each is read once

STEP_M = 1.0
HIGHEST_STEP_M = 0.15
SHARPEST_ON_ROADS_DEG = 5.0
SHARPEST_IN_JUNCTIONS_DEG = 10.0


@dataclass(frozen=True)
class Read:
    """A town as written and as the client has read it."""

    network: RoadNetwork
    map: carla.Map
    waypoints: list[carla.Waypoint]


@pytest.fixture(scope="module", params=list(PLANS))
def town(request) -> Read:
    plan = PLANS[request.param]
    client_map = carla.Map(plan.name, opendrive_of(plan))
    return Read(build_network(plan), client_map, client_map.generate_waypoints(4.0))


@pytest.fixture(scope="module")
def stage03() -> carla.Map:
    return carla.Map("Stage03", opendrive_of(PLANS["Stage03"]))


def angle_deg(a: carla.Transform, b: carla.Transform) -> float:
    return abs((a.rotation.yaw - b.rotation.yaw + 180.0) % 360.0 - 180.0)


def entries(town: Read) -> dict[tuple[int, int], tuple[carla.Waypoint, carla.Waypoint]]:
    """Each driving lane that ends at a junction: a waypoint on it and one inside."""
    found = {}
    for begin, end in town.map.get_topology():
        if end.is_junction and not begin.is_junction:
            found[begin.road_id, begin.lane_id] = begin, end
    return found


def test_every_driving_lane_goes_on_and_comes_from_somewhere(town):
    assert [(w.road_id, w.lane_id) for w in town.waypoints if not w.next(5.0)] == []
    assert [(w.road_id, w.lane_id) for w in town.waypoints if not w.previous(5.0)] == []


def test_random_walks_never_stall(town):
    rng = random.Random(7)
    for _ in range(12):
        waypoint = rng.choice(town.waypoints)
        for _ in range(400):
            onward = waypoint.next(2.0)
            assert onward, f"road {waypoint.road_id} lane {waypoint.lane_id} s {waypoint.s:.1f}"
            waypoint = rng.choice(onward)


def test_a_step_along_a_lane_jumps_neither_up_nor_aside_nor_round(town):
    for waypoint in town.waypoints:
        here = waypoint.transform
        for following in waypoint.next(STEP_M):
            there = following.transform
            where = f"road {waypoint.road_id} lane {waypoint.lane_id} s {waypoint.s:.1f}"
            assert abs(here.location.z - there.location.z) <= HIGHEST_STEP_M, where
            assert here.location.distance(there.location) == pytest.approx(STEP_M, abs=0.25), where
            inside = waypoint.is_junction or following.is_junction
            most = SHARPEST_IN_JUNCTIONS_DEG if inside else SHARPEST_ON_ROADS_DEG
            assert angle_deg(here, there) <= most, where


def test_lanes_meet_where_one_ends_and_the_next_begins(town):
    for road in town.network.roads:
        for lane in road.sections[0].lanes:
            if lane.kind is not LaneKind.DRIVING:
                continue
            s_m = road.length_m - 0.01 if lane.lane_id < 0 else 0.01
            last = town.map.get_waypoint_xodr(road.road_id, lane.lane_id, s_m)
            for following in last.next(0.02):
                there = following.transform
                assert (following.road_id, following.s) != (last.road_id, last.s)
                assert last.transform.location.distance(there.location) < 0.1
                assert angle_deg(last.transform, there) < 1.0


def test_every_road_can_be_reached_from_every_other(town):
    onward: dict[int, set[int]] = {}
    for begin, end in town.map.get_topology():
        # Lanes beside each other are joined by lane changes.
        onward.setdefault(begin.road_id, set()).update(
            {end.road_id, *(w.road_id for w in end.next(0.5))}
        )
    for start in list(onward)[::9]:
        seen, todo = {start}, [start]
        while todo:
            for other in onward.get(todo.pop(), set()) - seen:
                seen.add(other)
                todo.append(other)
        assert seen == set(onward)


def test_neighbouring_lanes_name_each_other(town):
    for waypoint in town.waypoints[::3]:
        right = waypoint.get_right_lane()
        if right is None or right.lane_id * waypoint.lane_id < 0:
            continue
        back = right.get_left_lane()
        assert back is not None
        assert (back.road_id, back.lane_id) == (waypoint.road_id, waypoint.lane_id)
        gap = right.transform.location.distance(waypoint.transform.location)
        assert gap == pytest.approx((right.lane_width + waypoint.lane_width) / 2, abs=0.05)


def test_crosswalk_outlines_are_closed_and_level(town):
    corners = town.map.get_crosswalks()
    assert len(corners) == 5 * sum(len(road.crosswalks) for road in town.network.roads) > 0
    for i in range(0, len(corners), 5):
        assert corners[i].distance(corners[i + 4]) < 1e-3
        assert corners[i].distance(corners[i + 2]) > 5.0
        heights = [corner.z for corner in corners[i : i + 5]]
        assert max(heights) - min(heights) < 0.01


def test_streets_with_crosswalks_have_sidewalks_beside_them(town):
    corners = town.map.get_crosswalks()
    for i in range(0, len(corners), 20):
        beside = town.map.get_waypoint(corners[i], lane_type=carla.LaneType.Sidewalk)
        assert beside is not None
        assert beside.transform.location.distance(corners[i]) < 4.0


def test_every_way_into_a_signalised_junction_passes_its_light(town):
    with_lights = {j.junction_id for j in town.network.junctions if j.controllers}
    for begin, inside in entries(town).values():
        junction = inside.get_junction().id
        last = begin.next_until_lane_end(1.0)[-1]
        before = last.previous(min(last.s if last.lane_id < 0 else 12.0, 12.0)) or [begin]
        marks = before[0].get_landmarks(20.0)
        lights = {mark.id for mark in marks if mark.type == "1000001"}
        assert bool(lights) == (junction in with_lights), f"road {begin.road_id}"
        assert all(int(light) // 10 == junction for light in lights)


def test_signs_name_lanes_of_their_road(town):
    lanes = {
        road.road_id: {lane.lane_id for section in road.sections for lane in section.lanes}
        for road in town.network.roads
    }
    for mark in town.map.get_all_landmarks():
        validities = mark.get_lane_validities()
        assert validities
        if mark.type == "1000001":
            continue
        for first, last in validities:
            assert set(range(first, last + 1)) <= lanes[mark.road_id]


def test_posted_limits_are_those_of_their_roads(town):
    limits = {road.road_id: road.speed_limit_kmh for road in town.network.roads}
    signs = [mark for mark in town.map.get_all_landmarks() if mark.type == "274"]
    assert len({sign.value for sign in signs}) >= 2
    for sign in signs:
        assert sign.value == limits[sign.road_id]
        assert sign.unit == "km/h"


def test_signs_look_against_the_traffic_that_they_are_for(town):
    for mark in town.map.get_all_landmarks():
        if mark.type == "1000001":
            continue
        first, _ = mark.get_lane_validities()[0]
        lane = town.map.get_waypoint_xodr(mark.road_id, first, mark.s)
        assert angle_deg(mark.transform, lane.transform) == pytest.approx(180.0, abs=0.5)
        local = mark.transform.location - lane.transform.location
        right = lane.transform.get_right_vector()
        assert local.x * right.x + local.y * right.y > lane.lane_width / 2


def test_lights_stand_off_the_road(town):
    for mark in town.map.get_all_landmarks():
        if mark.type != "1000001":
            continue
        place = mark.transform.location
        lane = town.map.get_waypoint(place, lane_type=carla.LaneType.Driving)
        away = lane.transform.location.distance(place)
        assert away > lane.lane_width / 2 + 0.5, f"light {mark.id}"


def test_junction_boxes_hold_their_paths(town):
    seen = set()
    for _, inside in entries(town).values():
        junction = inside.get_junction()
        if junction.id in seen:
            continue
        seen.add(junction.id)
        box = junction.bounding_box
        for pair in junction.get_waypoints(carla.LaneType.Driving):
            for waypoint in pair:
                place = waypoint.transform.location
                assert abs(place.x - box.location.x) <= box.extent.x + 2.0
                assert abs(place.y - box.location.y) <= box.extent.y + 2.0
    assert seen == {junction.junction_id for junction in town.network.junctions}


def test_the_origin_is_where_the_geo_reference_says(town):
    origin = town.map.transform_to_geolocation(carla.Location(0.0, 0.0, 0.0))
    network = town.network
    assert (origin.latitude, origin.longitude) == pytest.approx(
        (network.latitude_deg, network.longitude_deg)
    )


def test_a_roundabout_is_driven_counter_clockwise_and_yielded_to():
    client_map = carla.Map("Stage02", opendrive_of(PLANS["Stage02"]))
    (circle,) = PLANS["Stage02"].roundabouts
    x, y = circle.center[0], -circle.center[1]
    radius = circle.island_radius_m + circle.lane_width_m / 2
    for degrees in range(0, 360, 15):
        bearing = math.radians(degrees)
        place = carla.Location(x + radius * math.cos(bearing), y + radius * math.sin(bearing), 0)
        place.z = 1.0
        ahead = client_map.get_waypoint(place).transform.get_forward_vector()
        # Seen from above with CARLA's y to the south, counter-clockwise means falling angles.
        assert ahead.x * math.sin(bearing) - ahead.y * math.cos(bearing) > 0.8
    yields = [mark for mark in client_map.get_all_landmarks() if mark.type == "205"]
    near = [m for m in yields if m.transform.location.distance(carla.Location(x, y, 0)) < 60.0]
    assert len(near) == 4


def test_the_client_tells_the_bridge_from_the_motorway_below(stage03):
    (ring,) = PLANS["Stage03"].motorways
    y = ring.size_m[1] / 2
    bridge = stage03.get_waypoint(carla.Location(1.75, y, 6.2))
    below = stage03.get_waypoint(carla.Location(1.75, y + 6.0, 0.0))
    assert bridge.transform.location.z == pytest.approx(6.2, abs=0.01)
    assert below.transform.location.z == pytest.approx(0.0, abs=0.01)
    assert bridge.road_id != below.road_id


def test_motorway_lanes_can_be_changed(stage03):
    (ring,) = PLANS["Stage03"].motorways
    middle = ring.median_m + ring.inner_shoulder_m + 1.5 * ring.lane_width_m
    lane = stage03.get_waypoint(carla.Location(ring.size_m[0] / 2 - middle, 0.0, 0.0))
    assert lane.lane_change == carla.LaneChange.Both
    assert lane.get_left_lane().lane_type == carla.LaneType.Driving
    assert lane.get_right_lane().lane_type == carla.LaneType.Driving
