"""A gentle vehicle that events ask to be slow, to stand, and to drive beside its lane's middle."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import carla
import pytest

from carstage.collector.comfort import driving
from carstage.collector.comfort.driving import ComfortableDriving, Streets
from carstage.collector.comfort.road import StopLines
from carstage.collector.comfort.road_users import RoadUser
from carstage.spec import ComfortSpec

STEP_S = 0.1
LIMIT_KMH = 36.0
HALF_M = 2.4
EGO, OTHER = 1, 2
CREEPS_M_S = 1.5
"""Below, a step has no pedal that the Traffic Manager's share of so little speed stands for."""
PARTS, PRESSED = 5, 0.12
"""Pedals move within a step, as Unreal's do."""


class Place:
    """A waypoint of a straight road along the x axis."""

    road_id, lane_id = 7, -1

    def __init__(self, x_m: float) -> None:
        self.transform = carla.Transform(carla.Location(x_m, 0.0, 0.0))

    def next(self, distance_m: float) -> list[Place]:
        return [Place(self.transform.location.x + distance_m)]

    def get_landmarks(self, *_: Any) -> list[Any]:
        return []


class Ride:
    """A car that answers to the Traffic Manager's desired speed; somebody may stand on its way."""

    id = EGO
    bounding_box = carla.BoundingBox(carla.Location(), carla.Vector3D(HALF_M, 1.0, 0.7))

    def __init__(self, y_m: float = 0.0, speed_m_s: float = 10.0) -> None:
        self.x_m, self.y_m, self.speed_m_s = 0.0, y_m, speed_m_s
        self.desired_m_s = speed_m_s
        self.pedal = self._felt = 0.0
        self.other: carla.Location | None = None
        streets: Any = Streets(
            self, self, SimpleNamespace(get_waypoint=lambda at: Place(at.x)), StopLines(()), self,
            STEP_S,
        )  # fmt: skip
        self.driving = ComfortableDriving(streets, self, ComfortSpec())

    def get_speed_limit(self) -> float:
        return LIMIT_KMH

    def get_control(self) -> Any:
        brake = max(-self.pedal, 0.0) if self.desired_m_s > 0.0 else float("nan")
        return SimpleNamespace(throttle=max(self.pedal, 0.0), brake=brake)

    def vehicle_percentage_speed_difference(self, vehicle: Any, percent: float) -> None:
        self.desired_m_s = LIMIT_KMH / 3.6 * (1.0 - percent / 100.0)

    def distance_to_leading_vehicle(self, vehicle: Any, distance_m: float) -> None:
        """It stands where it is to, with nobody ahead."""

    def get_snapshot(self) -> Any:
        places = {EGO: (carla.Location(self.x_m, self.y_m, 0.0), self.speed_m_s)}
        if self.other is not None:
            places[OTHER] = self.other, 0.0

        def find(number: int) -> Any:
            at, speed_m_s = places[number]
            return SimpleNamespace(
                get_transform=lambda: carla.Transform(at),
                get_velocity=lambda: carla.Vector3D(speed_m_s, 0.0, 0.0),
            )

        return SimpleNamespace(find=find)

    def near(self, *_: Any) -> list[RoadUser]:
        return [] if self.other is None else [RoadUser(OTHER, HALF_M)]

    def step(self) -> None:
        self.driving.before_step()
        self.pedal = 0.0
        if self.desired_m_s > 0.0:
            error = (self.desired_m_s - self.speed_m_s) / self.desired_m_s
            self.pedal = min(max(12.0 * error, -0.7), 0.85)
        for _ in range(PARTS):
            self._felt += min(max(self.pedal - self._felt, -PRESSED), PRESSED)
            change_m_s2 = (5.0 if self._felt > 0.0 else 8.5) * self._felt - 0.2
            self.speed_m_s = max(self.speed_m_s + change_m_s2 * STEP_S / PARTS, 0.0)
            self.x_m += self.speed_m_s * STEP_S / PARTS


@pytest.fixture(autouse=True)
def no_forks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(driving, "coming_lanes", lambda *_: ())


def test_it_brakes_gently_and_stands_where_it_is_asked_to() -> None:
    ride, slowest = Ride(), 0.0
    for _ in range(200):
        ride.driving.ask(0.0, 60.0 - ride.x_m - HALF_M)
        before_m_s = ride.speed_m_s
        ride.step()
        if ride.speed_m_s > CREEPS_M_S:
            slowest = min(slowest, (ride.speed_m_s - before_m_s) / STEP_S)
    assert ride.desired_m_s == ride.speed_m_s == 0.0
    assert ride.x_m + HALF_M == pytest.approx(60.0, abs=1.5)
    assert slowest > -3.0
    ride.driving.ask(None)
    for _ in range(100):
        ride.step()
    assert ride.speed_m_s > 5.0


def test_it_is_as_slow_as_asked_from_a_place_on() -> None:
    ride, there_m_s = Ride(), 0.0
    for _ in range(150):
        ride.driving.ask(5.0, 60.0 - ride.x_m - HALF_M)
        ride.step()
        if not there_m_s and ride.x_m + HALF_M >= 60.0:
            there_m_s = ride.speed_m_s
    assert there_m_s == pytest.approx(5.0, abs=0.5)
    assert ride.speed_m_s == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize(("other_y_m", "brakes"), [(0.0, False), (-3.5, True)])
def test_beside_its_lane_it_heeds_who_is_on_its_way_there(other_y_m: float, brakes: bool) -> None:
    """Works are passed in the lane to the left; in its own lane somebody waits beyond them."""
    ride = Ride(y_m=-3.5)
    ride.driving.keep_aside(-3.5)
    ride.other = carla.Location(45.0, other_y_m, 0.0)
    for _ in range(40):
        ride.step()
    assert (ride.speed_m_s < 7.0) is brakes
