"""How vehicles are asked to drive before works, by the Traffic Manager's own terms."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import carla
import pytest

from carstage.collector.scenario.events.works_traffic import BEFORE_M, Works, WorksTraffic

STEP_S = 0.1
HALF_M = 2.4
FIRST_M = 70.0
ROLLS_M_S = 0.3


class Ego:
    """A car on the x axis."""

    id = 1
    bounding_box = carla.BoundingBox(carla.Location(), carla.Vector3D(HALF_M, 1.0, 0.7))

    def __init__(self, speed_m_s: float) -> None:
        self.x_m, self.speed_m_s = 0.0, speed_m_s

    def get_transform(self) -> Any:
        return carla.Transform(carla.Location(self.x_m, 0.0, 0.0))

    def get_velocity(self) -> Any:
        return carla.Vector3D(self.speed_m_s, 0.0, 0.0)


class World:
    """Somebody is in the oncoming lane; keeps what the Traffic Manager is asked for."""

    step_s = STEP_S
    ego_half_m = HALF_M

    def __init__(self, ego: Ego) -> None:
        self.ego = ego
        self.gentle = False
        self.asked_m_s: float | None = None
        self.within_m = 0.0

    def others(self) -> list[Any]:
        return []

    def first_taken(self, spots: Any) -> int:
        return 0

    def shift(self, vehicle: Any, right_m: float) -> None:
        raise AssertionError("it has to wait")

    def is_gentle(self, vehicle: Any) -> bool:
        return self.gentle

    def limit_speed(self, vehicle: Any, speed_m_s: float | None, within_m: float = 0.0) -> None:
        self.asked_m_s, self.within_m = speed_m_s, within_m


def stretch() -> Any:
    return SimpleNamespace(
        places=[
            SimpleNamespace(transform=carla.Transform(carla.Location(float(x), 0.0, 0.0)))
            for x in range(110)
        ]
    )


@pytest.mark.parametrize("speed_m_s", [3.0, 8.0, 11.0, 16.0])
def test_who_waits_for_works_is_asked_for_some_speed_until_it_stands(speed_m_s: float) -> None:
    """Of a speed of 0 the Traffic Manager makes pedals that are NaN: the car rolls on."""
    ego = Ego(speed_m_s)
    world: Any = World(ego)
    works = Works(FIRST_M, FIRST_M + 18.0, -3.5, 5.0, True, [(0.0, 3.5)] * 110, True)
    traffic = WorksTraffic(world, stretch(), works)
    for _ in range(600):
        traffic.step()
        if world.asked_m_s == 0.0:
            assert ego.speed_m_s < ROLLS_M_S
        wanted = speed_m_s if world.asked_m_s is None else min(world.asked_m_s, speed_m_s)
        change = min(max(wanted - ego.speed_m_s, -6.0 * STEP_S), 3.0 * STEP_S)
        ego.speed_m_s += change
        ego.x_m += ego.speed_m_s * STEP_S
    assert world.asked_m_s == ego.speed_m_s == 0.0
    assert ego.x_m + HALF_M == pytest.approx(FIRST_M - BEFORE_M, abs=1.5)


def test_who_is_gone_when_works_end_is_told_nothing_more() -> None:
    """Of who is gone, ``is_alive`` may say anything; the world around the ego knows."""
    ego = Ego(8.0)
    world: Any = World(ego)
    told: list[float] = []
    world.shift = lambda vehicle, right_m: told.append(right_m)
    works = Works(FIRST_M, FIRST_M + 18.0, -0.5, 5.0)
    traffic = WorksTraffic(world, stretch(), works)
    ego.x_m = FIRST_M - BEFORE_M
    traffic.step()
    assert world.asked_m_s == 5.0
    world.is_gone = lambda vehicle: True
    traffic.release()
    assert world.asked_m_s == 5.0
    world.is_gone = lambda vehicle: False
    traffic.release()
    assert world.asked_m_s is None
    assert told[-1] == 0.0


def test_who_is_past_one_works_is_left_to_the_next() -> None:
    ego = Ego(6.0)
    world: Any = World(ego)
    world.is_gone = lambda vehicle: False
    over_m: list[float] = []
    world.shift = lambda vehicle, right_m: over_m.append(right_m)
    first = WorksTraffic(world, stretch(), Works(20.0, 30.0, -0.5, 6.0))
    second = WorksTraffic(world, stretch(), Works(60.0, 100.0, -1.0, 6.0))
    while ego.x_m < 80.0:
        first.step()
        second.step()
        ego.x_m += ego.speed_m_s * STEP_S
    assert (over_m[-1], world.asked_m_s) == (-1.0, 6.0)
    first.release()
    assert (over_m[-1], world.asked_m_s) == (-1.0, 6.0)
    second.release()
    assert (over_m[-1], world.asked_m_s) == (0.0, None)


def test_who_drives_with_comfort_is_told_early_where_to_be_slow_and_where_to_stand() -> None:
    ego = Ego(10.0)
    world: Any = World(ego)
    world.gentle = True
    works = Works(FIRST_M, FIRST_M + 18.0, -3.5, 5.0, True, [(0.0, 3.5)] * 110, True)
    traffic = WorksTraffic(world, stretch(), works)
    traffic.step()
    assert world.asked_m_s == 5.0
    assert world.within_m == pytest.approx(FIRST_M - BEFORE_M - HALF_M)
    ego.x_m = 25.0
    traffic.step()
    assert world.asked_m_s == 0.0
    assert world.within_m == pytest.approx(FIRST_M - BEFORE_M - HALF_M - 25.0)
    ego.x_m = 120.0
    traffic.step()
    assert world.asked_m_s is None
