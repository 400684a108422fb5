"""What events see around the ego: only who is still there."""

from __future__ import annotations

import random
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import carla
import pytest

from carstage.collector.scenario.events import surroundings
from carstage.collector.scenario.events.surroundings import Surroundings


class Vehicle:
    """A vehicle on the x axis; whether it is alive is anybody's guess, as the client's is."""

    is_alive = True

    def __init__(self, number: int, x: float, speed_m_s: float = 0.0) -> None:
        self.id = number
        self._x, self._speed_m_s = x, speed_m_s

    def get_location(self) -> Any:
        return self.get_transform().location

    def get_transform(self) -> Any:
        return carla.Transform(carla.Location(self._x, 0.0, 0.0))

    def get_velocity(self) -> Any:
        return carla.Vector3D(self._speed_m_s, 0.0, 0.0)


class Frames:
    """A ``carla.World`` whose last frame shows some vehicles."""

    def __init__(self, shown: list[Vehicle]) -> None:
        self.shown = shown

    def get_snapshot(self) -> Any:
        by_id = {one.id: one for one in self.shown}
        return SimpleNamespace(frame=7, find=by_id.get)


def world_of(
    monkeypatch: pytest.MonkeyPatch,
    vehicles: list[Vehicle],
    ego: Vehicle,
    frames: Frames,
    agents: Sequence[Any] = (),
) -> Surroundings:
    monkeypatch.setattr(surroundings, "driven_by_traffic", lambda spec, population: vehicles)
    monkeypatch.setattr(surroundings, "personalities", lambda *_: [{} for _ in vehicles])
    population: Any = SimpleNamespace(vehicles=vehicles, ego=ego, agents=agents)
    session: Any = SimpleNamespace(world=frames)
    spec: Any = SimpleNamespace(step_s=0.1)
    return Surroundings(session, spec, population, 8000, random.Random(1))


def test_who_the_traffic_manager_has_destroyed_is_no_longer_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """``is_alive`` goes on to say that it is there: LibCarla has not set what that reads."""
    vehicles = [Vehicle(1, 10.0), Vehicle(2, 20.0)]
    frames = Frames(vehicles)
    world = world_of(monkeypatch, vehicles, Vehicle(3, 0.0), frames)
    places = [(10.0, 0.0), (20.0, 0.0)]
    assert world.first_taken(places) == 0
    assert not world.is_gone(vehicles[0])
    frames.shown = vehicles[1:]
    assert world.is_gone(vehicles[0])
    assert world.first_taken(places) == 1
    assert [one.actor.id for one in world.others()] == [2]
    assert not world.is_far(vehicles, 25.0)
    assert world.is_far(vehicles[:1], 25.0)


def test_cars_of_a_fleet_are_in_the_way_too(monkeypatch: pytest.MonkeyPatch) -> None:
    car = SimpleNamespace(actor=Vehicle(1, 10.0), spec=SimpleNamespace(vehicle=object()))
    mast = SimpleNamespace(actor=None, spec=SimpleNamespace(vehicle=None))
    world = world_of(monkeypatch, [], Vehicle(3, 0.0), Frames([car.actor]), (car, mast))
    assert world.first_taken([(10.0, 0.0)]) == 0


def test_who_is_there_is_seen_whatever_is_alive_says(monkeypatch: pytest.MonkeyPatch) -> None:
    vehicle = Vehicle(1, 10.0)
    vehicle.is_alive = False
    world = world_of(monkeypatch, [vehicle], Vehicle(3, 0.0), Frames([vehicle]))
    assert world.first_taken([(10.0, 0.0)]) == 0
    assert not world.is_gone(vehicle)


def test_the_ego_is_near_where_the_coming_step_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    world = world_of(monkeypatch, [], Vehicle(3, 0.0, speed_m_s=16.0), Frames([]))
    assert world.step_m == pytest.approx(1.6)
    assert world.will_be_near(carla.Location(21.5, 0.0, 0.0), 20.0)
    assert not world.will_be_near(carla.Location(21.7, 0.0, 0.0), 20.0)


class Blueprint:
    """A vehicle's ``carla.ActorBlueprint``, as servers before 0.9.14 have it."""

    def __init__(self, name: str, wheels: int) -> None:
        self.id = name
        self._wheels = wheels

    def has_attribute(self, name: str) -> bool:
        return name == "number_of_wheels"

    def get_attribute(self, name: str) -> Any:
        assert self.has_attribute(name)
        return SimpleNamespace(as_int=lambda: self._wheels)


def test_cars_of_servers_that_tell_no_base_type_are_cars(monkeypatch: pytest.MonkeyPatch) -> None:
    library = [
        Blueprint("vehicle.audi.a2", 4),
        Blueprint("vehicle.bh.crossbike", 2),
        Blueprint("vehicle.carlamotors.firetruck", 4),
        Blueprint("vehicle.of.somebody", 2),
    ]
    world: Any = SimpleNamespace(
        get_blueprint_library=lambda: SimpleNamespace(filter=lambda _: library)
    )
    around = world_of(monkeypatch, [], Vehicle(1, 0.0), world)
    found = {around.draw_car().id for _ in range(50)}  # type: ignore[union-attr]
    assert found == {"vehicle.audi.a2"}
