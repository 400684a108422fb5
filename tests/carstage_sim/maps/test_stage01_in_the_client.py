"""What the real client makes of Stage01's OpenDRIVE file, and whether the bake agrees with it."""

from __future__ import annotations

import math
from collections import Counter

import carla
import numpy as np
import pytest

from carstage_sim.maps import Town
from carstage_sim.maps.town import OrientedBox

pytestmark = pytest.mark.xdist_group("stage01 in the client")  # read once


@pytest.fixture(scope="module")
def client_map(stage01: Town) -> carla.Map:
    return carla.Map(stage01.name, stage01.opendrive)


@pytest.fixture(scope="module")
def waypoints(client_map: carla.Map) -> list[carla.Waypoint]:
    return client_map.generate_waypoints(2.0)


@pytest.fixture(scope="module")
def lights(client_map: carla.Map) -> dict[str, carla.Landmark]:
    found = [mark for mark in client_map.get_all_landmarks() if mark.type == "1000001"]
    return {mark.id: mark for mark in found}


def angle_deg(a: float, b: float) -> float:
    return abs((a - b + 180.0) % 360.0 - 180.0)


def inside(box: OrientedBox, point: carla.Location) -> bool:
    yaw = math.radians(box.rotation_deg[1])
    dx, dy = point.x - box.center[0], point.y - box.center[1]
    along = dx * math.cos(yaw) + dy * math.sin(yaw)
    across = -dx * math.sin(yaw) + dy * math.cos(yaw)
    return abs(along) <= box.extent[0] and abs(across) <= box.extent[1]


def test_no_driving_lane_is_a_dead_end(waypoints):
    assert len(waypoints) > 2000
    assert [w for w in waypoints if not w.next(3.0)] == []
    assert [w for w in waypoints if not w.previous(3.0)] == []


def test_every_lane_can_be_reached_from_every_other(client_map):
    def lane(waypoint: carla.Waypoint) -> tuple[int, int]:
        return waypoint.road_id, waypoint.lane_id

    onward: dict[tuple[int, int], set[tuple[int, int]]] = {}
    for begin, end in client_map.get_topology():
        # A topology edge runs along one lane and ends where the next begins.
        following = {lane(w) for w in end.next(0.5)} | {lane(end)}
        onward.setdefault(lane(begin), set()).update(following)

    def reached(start: tuple[int, int]) -> set[tuple[int, int]]:
        seen, todo = {start}, [start]
        while todo:
            for other in onward.get(todo.pop(), set()) - seen:
                seen.add(other)
                todo.append(other)
        return seen

    # Lanes beside each other are joined by lane changes.
    roads = {road for road, _ in onward}
    for start in list(onward)[::7]:
        assert {road for road, _ in reached(start)} == roads


def test_crosswalk_outlines_are_closed(client_map, stage01):
    corners = client_map.get_crosswalks()
    assert len(corners) == 5 * len(stage01.traffic_lights)
    for i in range(0, len(corners), 5):
        assert corners[i].distance(corners[i + 4]) < 1e-3
        assert corners[i].distance(corners[i + 2]) > 5.0


def test_a_light_stands_where_its_landmark_is(lights, stage01):
    assert set(lights) == {site.sign_id for site in stage01.traffic_lights}
    for site in stage01.traffic_lights:
        place = lights[site.sign_id].transform.location
        assert math.dist((place.x, place.y), site.location[:2]) < 0.3


def test_lenses_look_against_the_traffic_that_they_govern(client_map, lights, stage01):
    for site in stage01.traffic_lights:
        facing = site.rotation_deg[1] + site.head[3]
        assert angle_deg(lights[site.sign_id].transform.rotation.yaw, facing) < 0.1
        for box in site.trigger:
            lane = client_map.get_waypoint(carla.Location(*box.center))
            assert angle_deg(lane.transform.rotation.yaw, facing) == pytest.approx(180.0, abs=0.1)


def test_a_light_is_ahead_of_and_in_front_of_its_lanes(client_map, stage01):
    for site in stage01.traffic_lights:
        yaw = math.radians(site.rotation_deg[1])
        head = np.array(site.location[:2]) + site.head[0] * np.array([math.cos(yaw), math.sin(yaw)])
        for box in site.trigger:
            lane = client_map.get_waypoint(carla.Location(*box.center)).transform
            ahead, right = lane.get_forward_vector(), lane.get_right_vector()
            way = head - np.array(box.center[:2])
            assert 15.0 < way @ np.array([ahead.x, ahead.y]) < 60.0
            assert abs(way @ np.array([right.x, right.y])) < 3.6


def test_every_inbound_lane_knows_its_light(client_map, stage01):
    for site in stage01.traffic_lights:
        for box in site.trigger:
            lane = client_map.get_waypoint(carla.Location(*box.center))
            ahead = [mark for mark in lane.get_landmarks(20.0) if mark.type == "1000001"]
            assert [mark.id for mark in ahead] == [site.sign_id]


def test_triggers_are_as_large_as_carla_s_and_leave_room_for_a_crosswalk(client_map, stage01):
    for site in stage01.traffic_lights:
        for box in site.trigger:
            lane = client_map.get_waypoint(carla.Location(*box.center))
            assert not lane.is_junction
            distance, current = 0.0, lane
            while not current.is_junction:
                distance, current = distance + 0.5, current.next(0.5)[0]
            assert current.get_junction().id == site.junction_id
            assert 2 * box.extent[1] == pytest.approx(3.0)
            assert distance - box.extent[1] > 4.0  # room for a stop line and a crosswalk
            assert box.extent[0] == pytest.approx(lane.lane_width / 4)


def test_every_way_into_a_junction_passes_a_trigger(client_map, stage01):
    boxes = [box for site in stage01.traffic_lights for box in site.trigger]
    entries = {
        (end.road_id, end.lane_id): begin
        for begin, end in client_map.get_topology()
        if end.is_junction and not begin.is_junction
    }
    assert entries
    for begin in {(b.road_id, b.lane_id): b for b in entries.values()}.values():
        current, hit = begin, False
        while not current.is_junction:
            hit = hit or any(inside(box, current.transform.location) for box in boxes)
            current = current.next(1.0)[0]
        assert hit, f"road {begin.road_id} lane {begin.lane_id} enters without a light"


def test_no_two_approaches_of_a_junction_share_a_phase(stage01):
    phases = Counter((site.junction_id, site.phase) for site in stage01.traffic_lights)
    assert set(phases.values()) == {1}
    per_junction = Counter(junction for junction, _ in phases)
    assert set(per_junction.values()) == {3, 4}  # grid corners are bends, not junctions


def test_spawn_points_are_on_lanes_with_room_around_them(client_map, stage01):
    points = stage01.spawn_points
    assert len(points) >= 120
    gaps = np.linalg.norm(points[:, None, :2] - points[None, :, :2], axis=2)
    gaps += np.where(np.eye(len(points)), np.inf, 0.0)
    assert gaps.min() >= 8.0
    for x, y, z, pitch, yaw, roll in points:
        lane = client_map.get_waypoint(carla.Location(x, y, 0.0))
        assert 0.3 <= z <= 0.6
        assert (pitch, roll) == (0.0, 0.0)
        assert math.dist((x, y), (lane.transform.location.x, lane.transform.location.y)) < 0.15
        assert angle_deg(yaw, lane.transform.rotation.yaw) < 1.5
        assert not lane.is_junction
        assert not any(w.is_junction for w in lane.next(10.0))


def test_the_first_spawn_points_are_scattered_over_the_town(stage01):
    first = stage01.spawn_points[:20, :2]
    extent = np.ptp(stage01.spawn_points[:, :2], axis=0)
    assert (np.ptp(first, axis=0) > 0.6 * extent).all()


def test_baked_lanes_agree_with_the_client(client_map, stage01):
    lanes = stage01.lanes
    for i in range(0, len(lanes.s_m), 97):
        x, y, z = lanes.location[i]
        waypoint = client_map.get_waypoint_xodr(
            int(lanes.road_id[i]), int(lanes.lane_id[i]), float(lanes.s_m[i])
        )
        assert waypoint.transform.location.distance(carla.Location(x, y, z)) < 1e-3
        assert waypoint.is_junction == (lanes.junction_id[i] != -1)
        assert waypoint.lane_width == pytest.approx(lanes.width_m[i])
    assert set(np.unique(lanes.speed_limit_kmh)) == {30.0, 40.0}


def test_posted_limits_hold_for_their_lanes(client_map, stage01):
    limits = {
        (int(road), int(lane)): float(limit)
        for road, lane, limit in zip(
            stage01.lanes.road_id,
            stage01.lanes.lane_id,
            stage01.lanes.speed_limit_kmh,
            strict=True,
        )
    }
    signs = [mark for mark in client_map.get_all_landmarks() if mark.type == "274"]
    assert signs
    for sign in signs:
        for first, last in sign.get_lane_validities():
            for lane in range(first, last + 1):
                assert limits[sign.road_id, lane] == sign.value


def test_the_origin_is_where_the_geo_reference_says(client_map, stage01):
    origin = client_map.transform_to_geolocation(carla.Location(0.0, 0.0, 0.0))
    assert (origin.latitude, origin.longitude) == pytest.approx(stage01.geo_reference)
