"""The way that driver ``route`` follows: by road, evenly spaced, and as the turns say."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import pytest

from carstage.collector.drivers.path_ahead import SPACING_M, PathAhead
from carstage.collector.drivers.route import _radii


class Spot(NamedTuple):
    """A place, as ``carla.Location``."""

    x: float
    y: float


class Lane:
    """A straight lane, as a ``carla.Waypoint`` on it; it forks at its end."""

    def __init__(
        self, x: float, y: float, yaw_deg: float, left_m: float, road_id: int, forks: bool
    ) -> None:
        self.place, self.yaw_deg, self.left_m = Spot(x, y), yaw_deg, left_m
        self.road_id, self.lane_id, self.forks = road_id, -1, forks

    @property
    def transform(self) -> Any:
        lane = self

        class Transform:
            location = lane.place
            rotation = type("Rotation", (), {"yaw": lane.yaw_deg})

        return Transform

    def moved(self, distance_m: float) -> Lane:
        yaw = math.radians(self.yaw_deg)
        x = self.place.x + distance_m * math.cos(yaw)
        y = self.place.y + distance_m * math.sin(yaw)
        return Lane(x, y, self.yaw_deg, self.left_m - distance_m, self.road_id, self.forks)

    def next(self, distance_m: float) -> list[Lane]:
        if self.left_m >= distance_m:
            return [self.moved(distance_m)]
        if not self.forks:
            return []
        x, y = self.place
        return [
            Lane(x, y, self.yaw_deg + turn, 20.0, self.road_id + i, True).moved(distance_m)
            for i, turn in ((1, 90.0), (2, 0.0), (3, -90.0))
        ]

    def next_until_lane_end(self, distance_m: float) -> list[Lane]:
        count = int(self.left_m / distance_m)
        return [self.moved(distance_m * (i + 1)) for i in range(count)]


class Map:
    """Knows one lane."""

    def __init__(self, forks: bool = True) -> None:
        self.lane = Lane(0.0, 0.0, 0.0, 20.0, 10, forks)

    def get_waypoint(self, place: Any) -> Lane:
        return self.lane.moved(place.x)


@pytest.mark.parametrize(
    ("turns", "end"),
    [
        ([], (60.0, 0.0)),
        (["left"], (20.0, -40.0)),
        (["right", "left"], (40.0, 20.0)),
        (["straight", "right"], (40.0, 20.0)),
    ],
)
def test_turns_are_taken_one_after_the_other(turns: list[str], end: tuple[float, float]) -> None:
    path = PathAhead(Map(), Spot(0.0, 0.0), [], turns)
    path.reach(31)  # 60 m: two junctions
    assert path.places[-1] == pytest.approx(end, abs=1e-9)
    gaps = [math.dist(a, b) for a, b in zip(path.places, path.places[1:], strict=False)]
    assert gaps == pytest.approx([SPACING_M] * 30)


def test_a_route_is_spaced_evenly_and_the_road_goes_on_after_it() -> None:
    corners = [Spot(0.0, 0.0), Spot(4.0, 0.0), Spot(8.0, 0.0), Spot(12.0, 0.0)]
    path = PathAhead(Map(forks=False), Spot(0.0, 0.0), corners, [])
    assert path.places == [(2.0 * i, 0.0) for i in range(7)]
    path.reach(100)
    assert path.places[-1] == pytest.approx((20.0, 0.0)), "the road ends there"


def test_the_ego_is_followed_and_never_found_far_behind() -> None:
    path = PathAhead(Map(forks=False), Spot(0.0, 0.0), [], [])
    path.reach(11)
    assert [path.follow(x, 0.4) for x in (0.0, 3.1, 9.2, 8.9)] == [0, 2, 5, 4]
    assert path.nearest(6.0, 1.5, 0, 11) == (3, 1.5)


def test_radii_are_those_of_the_circle() -> None:
    circle = [(12.0 * math.cos(a / 6.0), 12.0 * math.sin(a / 6.0)) for a in range(8)]
    assert _radii(circle) == pytest.approx([12.0] * 4)
    assert min(_radii([(float(x), 0.0) for x in range(6)])) >= 1e4
