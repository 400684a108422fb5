"""How drones get from step to step, and where masts stand at junctions."""

from __future__ import annotations

import itertools
import math

import carla
import numpy as np
import pytest

from carstage.collector.drones import DroneMotion
from carstage.collector.internals.errors import SceneError
from carstage.collector.junctions import junction_transform
from carstage.geometry import rotation_matrix
from carstage.spec import (
    DroneSpec,
    EgoPlace,
    FollowSpec,
    GimbalSpec,
    JunctionSpec,
    OrbitSpec,
    WaypointsSpec,
)
from carstage_sim.maps.writer import PLANS, opendrive_of

STEP_S = 0.1
AT_HOME = EgoPlace(0.0, 0.0, 0.0, 0.0)


def flown(spec: DroneSpec, egos: list[EgoPlace]) -> list[DroneMotion]:
    """The states of a drone, the first one before it flies."""
    states = []
    for number in range(len(egos)):
        drone = DroneMotion(spec, STEP_S, egos[0])
        for tick in range(1, number + 1):
            drone.advance(tick * STEP_S, egos[tick])
        states.append(drone)
    return states


def test_a_path_flown_at_the_greatest_speed_is_kept_exactly() -> None:
    path = WaypointsSpec(((0.0, 0.0, 30.0), (7.0, 3.0, 30.0), (9.0, 9.0, 12.0)), speed_m_s=12.0)
    for tick, drone in enumerate(flown(DroneSpec(path, GimbalSpec(), 12.0), [AT_HOME] * 20)):
        assert drone.pose.place == path.at(tick * STEP_S).place


def test_a_drone_that_rises_or_sinks_heads_for_the_next_level_leg_or_as_on_the_last() -> None:
    ground, up, east = (0.0, 0.0, 0.0), (0.0, 0.0, 40.0), (40.0, 0.0, 40.0)
    south = (40.0, 40.0, 40.0)
    path = WaypointsSpec((ground, up, east, south, (40.0, 40.0, 0.0)), speed_m_s=10.0)
    headings = {time_s: path.at(time_s).heading_deg for time_s in (0.0, 2.0, 5.0, 10.0, 13.0, 99.0)}
    assert headings == pytest.approx({0.0: 0, 2.0: 0, 5.0: 0, 10.0: 90, 13.0: 90, 99.0: 90})
    loop = WaypointsSpec((ground, east, south, up), speed_m_s=10.0, loop=True)
    sinking_s = sum(math.dist(*leg) for leg in itertools.pairwise(loop.points)) / 10.0 + 1.0
    assert loop.at(sinking_s).heading_deg == pytest.approx(0.0)


def test_a_drone_behind_a_fast_ego_is_no_faster_than_it_may_be() -> None:
    egos = [EgoPlace(3.0 * tick, 0.0, 0.0, 0.0) for tick in range(15)]  # 30 m/s
    spec = DroneSpec(FollowSpec(-10.0, 0.0, 20.0), GimbalSpec(), 10.0)
    places = [drone.pose.place for drone in flown(spec, egos)]
    steps = [math.dist(*pair) for pair in itertools.pairwise(places)]
    assert steps == pytest.approx([10.0 * STEP_S] * len(steps))


def test_velocity_acceleration_and_turning_are_those_of_the_poses() -> None:
    spec = DroneSpec(
        OrbitSpec(15.0, 10.0, 6.0, center=(0.0, 0.0, 0.0)), GimbalSpec(look_at=(9.0, 2.0, 0.0)), 9.0
    )
    states = flown(spec, [AT_HOME] * 8)
    for before, now in itertools.pairwise(states[1:]):
        moved = np.subtract(now.pose.place, before.pose.place) / STEP_S
        assert now.motion.velocity == pytest.approx(moved)
        changed = np.subtract(now.motion.velocity, before.motion.velocity) / STEP_S
        assert now.motion.acceleration == pytest.approx(changed)
        old, new = (rotation_matrix((one.pose.pitch_deg, one.pose.yaw_deg, 0.0))
                    for one in (before, now))  # fmt: skip
        turned = (new @ old.T - np.eye(3)) / STEP_S
        omega = np.radians(now.motion.angular_velocity_deg)
        skew = np.array([turned[2, 1], turned[0, 2], turned[1, 0]])
        assert np.linalg.norm(skew - omega) < 0.1 * np.linalg.norm(omega)


@pytest.fixture(scope="module")
def town() -> carla.Map:
    return carla.Map("Stage01", opendrive_of(PLANS["Stage01"]))


def test_a_mast_stands_beside_its_road_and_looks_at_the_junction(town: carla.Map) -> None:
    start = town.generate_waypoints(20.0)[0].transform
    for arm in range(3):
        place = junction_transform(town, JunctionSpec(7.0, arm, near_ego=True), start, "agents[0]")
        road = town.get_waypoint(place.location)
        assert place.location.z == pytest.approx(road.transform.location.z + 7.0, abs=0.3)
        away_m = math.hypot(
            place.location.x - road.transform.location.x,
            place.location.y - road.transform.location.y,
        )
        assert away_m > road.lane_width / 2.0  # on no lane
        ahead = place.get_forward_vector()
        reach_m = (road.transform.location.z - place.location.z) / ahead.z
        seen = place.location + carla.Location(*(reach_m * v for v in (ahead.x, ahead.y, ahead.z)))
        assert town.get_waypoint(seen).is_junction


def test_junctions_are_found_by_id_and_by_a_draw(town: carla.Map) -> None:
    start = town.generate_waypoints(20.0)[0].transform
    found = {begin.get_junction().id for begin, _ in town.get_topology() if begin.is_junction}
    places = {
        (round(one.location.x), round(one.location.y))
        for draw in np.linspace(0.0, 0.999, 12)
        for one in [junction_transform(town, JunctionSpec(7.0, 0, draw=draw), start, "agents[0]")]
    }
    assert 1 < len(places) <= len(found)
    with pytest.raises(SceneError, match=r"agents\[0\].junction: the map has no such junction"):
        junction_transform(town, JunctionSpec(7.0, 0, id=999_999), start, "agents[0]")
    with pytest.raises(SceneError, match=r"agents\[0\].arm: junction \d+ has no road 9"):
        junction_transform(town, JunctionSpec(7.0, 9, near_ego=True), start, "agents[0]")
