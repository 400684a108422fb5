"""What events see around the ego: only who is still there."""

from __future__ import annotations

import random
from types import SimpleNamespace
from typing import Any

import carla
import pytest

from carstage.collector.scenario.events import surroundings
from carstage.collector.scenario.events.surroundings import Surroundings


class Vehicle:
    """A vehicle whose functions fail, as the client's do, once it is destroyed."""

    def __init__(self, number: int, x: float, speed_m_s: float = 0.0) -> None:
        self.id = number
        self.is_alive = True
        self.goes_when_read = False
        self._x, self._speed_m_s = x, speed_m_s

    def get_location(self) -> Any:
        return self.get_transform().location

    def get_transform(self) -> Any:
        if self.goes_when_read:
            self.is_alive = False
        if not self.is_alive:
            raise RuntimeError("trying to operate on a destroyed actor")
        return carla.Transform(carla.Location(self._x, 0.0, 0.0))

    def get_velocity(self) -> Any:
        return carla.Vector3D(self._speed_m_s, 0.0, 0.0)


class Broken(Vehicle):
    """Is there, and cannot be read."""

    def get_transform(self) -> Any:
        raise RuntimeError("the server does not answer")


def world_of(
    monkeypatch: pytest.MonkeyPatch, vehicles: list[Vehicle], ego: Vehicle
) -> Surroundings:
    monkeypatch.setattr(surroundings, "driven_by_traffic", lambda spec, population: vehicles)
    monkeypatch.setattr(surroundings, "personalities", lambda *_: [{} for _ in vehicles])
    population: Any = SimpleNamespace(vehicles=vehicles, ego=ego)
    session: Any = SimpleNamespace()
    spec: Any = SimpleNamespace(step_s=0.1)
    return Surroundings(session, spec, population, 8000, random.Random(1))


def test_who_the_traffic_manager_has_destroyed_is_no_longer_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    vehicles = [Vehicle(1, 10.0), Vehicle(2, 20.0)]
    world = world_of(monkeypatch, vehicles, Vehicle(3, 0.0))
    places = [(10.0, 0.0), (20.0, 0.0)]
    assert world.first_taken(places) == 0
    vehicles[0].is_alive = False
    assert world.first_taken(places) == 1
    assert [one.actor.id for one in world.others()] == [2]
    assert not world.is_far(vehicles, 25.0)
    assert world.is_far(vehicles[:1], 25.0)


def test_who_goes_while_it_is_read_is_no_longer_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    vehicles = [Vehicle(1, 10.0), Vehicle(2, 20.0)]
    world = world_of(monkeypatch, vehicles, Vehicle(3, 0.0))
    vehicles[0].goes_when_read = True
    assert world.first_taken([(10.0, 0.0), (20.0, 0.0)]) == 1


def test_an_error_of_who_is_there_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    world = world_of(monkeypatch, [Broken(1, 10.0)], Vehicle(3, 0.0))
    with pytest.raises(RuntimeError, match="does not answer"):
        world.others()


def test_the_ego_is_near_where_the_coming_step_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    world = world_of(monkeypatch, [], Vehicle(3, 0.0, speed_m_s=16.0))
    assert world.step_m == pytest.approx(1.6)
    assert world.will_be_near(carla.Location(21.5, 0.0, 0.0), 20.0)
    assert not world.will_be_near(carla.Location(21.7, 0.0, 0.0), 20.0)
