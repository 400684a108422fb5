"""Where drones are, and where their gimbals are turned to, at a time."""

from __future__ import annotations

import json
from math import atan2, degrees, dist, hypot, sqrt

import pytest

from carstage.spec import (
    DroneSpec,
    EgoPlace,
    Fields,
    FollowSpec,
    GimbalSpec,
    OrbitSpec,
    SpecError,
    WaypointsSpec,
)
from carstage.spec.plain import plain

EGO = EgoPlace(10.0, -5.0, 0.5, 90.0)
CORNER = WaypointsSpec(((0.0, 0.0, 30.0), (20.0, 0.0, 30.0), (20.0, 10.0, 30.0)), speed_m_s=5.0)


@pytest.mark.parametrize(
    ("time_s", "place"),
    [
        (0.0, (0.0, 0.0, 30.0)),
        (1.0, (5.0, 0.0, 30.0)),
        (4.0, (20.0, 0.0, 30.0)),
        (5.0, (20.0, 5.0, 30.0)),
        (6.0, (20.0, 10.0, 30.0)),
        (60.0, (20.0, 10.0, 30.0)),
    ],
)
def test_waypoints_are_flown_at_one_speed_up_to_the_last(
    time_s: float, place: tuple[float, float, float]
) -> None:
    assert CORNER.at(time_s).place == pytest.approx(place)


def test_a_loop_comes_back_to_its_first_point() -> None:
    loop = WaypointsSpec(CORNER.points, speed_m_s=5.0, loop=True)
    length_m = 30.0 + hypot(20.0, 10.0)
    assert loop.at(length_m / 5.0).place == pytest.approx(loop.points[0])
    assert loop.at(length_m / 5.0 + 1.0).place == pytest.approx(loop.at(1.0).place)


def test_a_drone_turns_into_a_corner_ahead_of_it_and_keeps_its_heading_at_the_end() -> None:
    assert CORNER.at(2.0).heading_deg == pytest.approx(0.0)
    assert CORNER.at(3.5).heading_deg == pytest.approx(degrees(atan2(2.5, 2.5)))
    assert CORNER.at(4.5).heading_deg == pytest.approx(90.0)
    assert CORNER.at(60.0).heading_deg == pytest.approx(90.0)


def test_a_climb_straight_up_has_the_heading_of_the_last_level_leg() -> None:
    up = WaypointsSpec(((0.0, 0.0, 5.0), (0.0, -8.0, 5.0), (0.0, -8.0, 60.0)), speed_m_s=2.0)
    assert up.at(15.0).heading_deg == pytest.approx(-90.0)
    assert WaypointsSpec(((0.0, 0.0, 5.0), (0.0, 0.0, 60.0)), 2.0).at(1.0).heading_deg == 0.0


@pytest.mark.parametrize(("clockwise", "way"), [(True, 1.0), (False, -1.0)])
def test_an_orbit_keeps_radius_height_and_speed(clockwise: bool, way: float) -> None:
    orbit = OrbitSpec(20.0, 30.0, 6.0, start_deg=0.0, clockwise=clockwise, center=(1.0, 2.0, 3.0))
    for time_s in (0.0, 1.0, 7.5):
        x, y, z = orbit.at(time_s).place
        assert hypot(x - 1.0, y - 2.0) == pytest.approx(20.0)
        assert z == pytest.approx(33.0)
    ahead = orbit.at(1e-3)
    assert dist(ahead.place, orbit.at(0.0).place) == pytest.approx(6e-3, rel=1e-6)
    assert ahead.place[1] * way > 2.0 * way  # +y is to the right of +x
    assert ahead.heading_deg == pytest.approx(way * 90.0 % 360.0, abs=0.1)


def test_paths_at_the_ego_go_along_with_it() -> None:
    assert OrbitSpec(20.0, 30.0, 6.0, start_deg=0.0).at(0.0, EGO).place == pytest.approx(
        (30.0, -5.0, 30.5)
    )
    behind = FollowSpec(x_m=-10.0, y_m=2.0, height_m=20.0).at(3.0, EGO)
    assert behind.place == pytest.approx((8.0, -15.0, 20.5))
    assert behind.heading_deg == 90.0


def test_a_gimbal_turns_by_its_angles_or_to_its_target() -> None:
    place = (0.0, -5.0, 10.5)
    assert GimbalSpec(-30.0, 15.0).direction(place, 40.0, None) == (-30.0, 55.0)
    assert GimbalSpec(look_at_ego=True).direction(place, 40.0, EGO) == pytest.approx((-45.0, 0.0))
    below = GimbalSpec(look_at=(0.0, -5.0, 0.0)).direction(place, 40.0, None)
    assert below == pytest.approx((-89.9, 40.0))
    pitch_deg, yaw_deg = GimbalSpec(look_at=(1.0, -4.0, 10.5 + sqrt(2.0))).direction(
        place, 0.0, None
    )
    assert (pitch_deg, yaw_deg) == pytest.approx((45.0, 45.0))


@pytest.mark.parametrize(
    "drone",
    [
        DroneSpec(CORNER, GimbalSpec(-90.0), 12.0),
        DroneSpec(OrbitSpec(5.0, 9.0, 2.0), GimbalSpec(look_at_ego=True), 9.0),
        DroneSpec(
            OrbitSpec(5.0, 9.0, 2.0, center=(1.0, 2.0, 3.0)),
            GimbalSpec(look_at=(1.0, 2.0, 3.0)),
            9.0,
        ),
        DroneSpec(FollowSpec(1.0, 2.0, 3.0), GimbalSpec(), 9.0),
    ],
)
def test_a_drone_survives_json(drone: DroneSpec) -> None:
    document = json.loads(json.dumps(plain(drone)))
    assert DroneSpec.read(Fields(document, "drone")) == drone
    assert drone.looks_at_ego == (drone.path.follows_ego or drone.gimbal.look_at_ego)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": [[0, 0, 1]]}, "drone.path.points: must be two"),
        ({"points": [[0, 0, 1], [0, 0, 1]]}, "drone.path.points: must be two"),
        ({"points": [[0, 0, 1], [0, 1]]}, r"drone.path.points\[1\]: must be \[x, y, z\]"),
        ({"speed_m_s": 101.0}, "drone.path.speed_m_s: 101 is out of range"),
        ({"kind": "dive"}, "drone.path.kind: 'dive' is not known"),
    ],
)
def test_a_path_that_cannot_be_is_refused(change: dict[str, object], message: str) -> None:
    document = plain(DroneSpec(CORNER, GimbalSpec(), 9.0))
    document["path"].update(change)
    with pytest.raises(SpecError, match=message):
        DroneSpec.read(Fields(document, "drone"))
