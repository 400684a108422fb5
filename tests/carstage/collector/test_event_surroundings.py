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

    def __init__(self, number: int, x: float) -> None:
        self.id = number
        self.is_alive = True
        self._x = x

    def get_location(self) -> Any:
        if not self.is_alive:
            raise RuntimeError("trying to operate on a destroyed actor")
        return carla.Location(self._x, 0.0, 0.0)


def test_who_the_traffic_manager_has_destroyed_is_no_longer_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    vehicles = [Vehicle(1, 10.0), Vehicle(2, 20.0)]
    monkeypatch.setattr(surroundings, "driven_by_traffic", lambda spec, population: vehicles)
    monkeypatch.setattr(surroundings, "personalities", lambda *_: [{}, {}])
    population: Any = SimpleNamespace(vehicles=vehicles, ego=Vehicle(3, 0.0))
    session: Any = SimpleNamespace()
    spec: Any = SimpleNamespace(step_s=0.1)
    world = Surroundings(session, spec, population, 8000, random.Random(1))
    places = [(10.0, 0.0), (20.0, 0.0)]
    assert world.first_taken(places) == 0
    vehicles[0].is_alive = False
    assert world.first_taken(places) == 1
    assert [one.id for one in world.others()] == [2]
