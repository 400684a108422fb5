"""How many vehicles of which blueprints are spawned where, in a world that only counts."""

from __future__ import annotations

import logging
from dataclasses import replace
from fnmatch import fnmatchcase
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("carla")

import carla

from carstage.collector.actors import spawn_vehicles
from carstage.collector.internals.errors import SceneError
from carstage.collector.internals.plan import parse_plan
from carstage.spec import EpisodeSpec, GroupSpec, VehiclesSpec

KINDS = {"vehicle.a.car": ("car", "1"), "vehicle.b.truck": ("truck", "2")}
START = carla.Transform(carla.Location(0.0, 0.0, 0.0))


class Blueprint:
    """One of two blueprints with a class and a generation."""

    def __init__(self, name: str) -> None:
        self.id = name
        self.values = dict(zip(("base_type", "generation"), KINDS[name], strict=True))

    def has_attribute(self, name: str) -> bool:
        return name in self.values

    def get_attribute(self, name: str) -> Any:
        integer = name == "generation"
        kinds = carla.ActorAttributeType
        return SimpleNamespace(
            type=kinds.Int if integer else kinds.String,
            as_int=lambda: int(self.values[name]),
            as_str=lambda: self.values[name].upper(),
        )

    def set_attribute(self, name: str, value: str) -> None:
        assert (name, value) == ("role_name", "autopilot")


class Session:
    """A map with the ego's spawn point and three others; a vehicle for every place."""

    def __init__(self) -> None:
        self.spawned: list[tuple[str, float]] = []
        places = [carla.Transform(carla.Location(x, 0.0, 0.0)) for x in (0.0, 50.0, 200.0, 20.0)]
        between = [
            SimpleNamespace(transform=carla.Transform(carla.Location(x, 5.0, 0.0)))
            for x in (10.0, 30.0)
        ]
        self.map = SimpleNamespace(
            get_spawn_points=lambda: places, generate_waypoints=lambda distance_m: between
        )
        names = sorted(KINDS)
        library = SimpleNamespace(
            filter=lambda pattern: [Blueprint(n) for n in names if fnmatchcase(n, pattern)]
        )
        self.world = SimpleNamespace(get_blueprint_library=lambda: library)

    def try_spawn(self, blueprint: Blueprint, place: Any) -> Any:
        self.spawned.append((blueprint.id, place.location.x))
        return SimpleNamespace(id=len(self.spawned))

    def destroy_on_exit(self, what: str, actor: Any) -> None:
        pass


@pytest.fixture
def spec(make_plan: Any) -> EpisodeSpec:
    return parse_plan(make_plan()).episodes[0].spec


def spawn(spec: EpisodeSpec, *groups: GroupSpec, shortfall: str = "warn") -> list[tuple[str, Any]]:
    session: Any = Session()
    *first, last = groups
    plan = VehiclesSpec(last.count, last.filter, 100.0, last.generation, tuple(first), shortfall)
    spawn_vehicles(session, replace(spec, vehicles=plan), START)
    spawned: list[tuple[str, Any]] = session.spawned
    return spawned


def test_near_spawn_points_come_first_and_the_ego_keeps_its_own(spec: EpisodeSpec) -> None:
    xs = [x for _, x in spawn(spec, GroupSpec(3, "vehicle.*"))]
    assert sorted(xs[:2]) == [20.0, 50.0]
    assert xs[2] == 200.0


def test_groups_have_the_class_and_generation_that_were_asked_for(spec: EpisodeSpec) -> None:
    trucks, first = GroupSpec(1, "vehicle.*", "truck"), GroupSpec(2, "vehicle.*", generation="1")
    names = [name for name, _ in spawn(spec, trucks, first)]
    assert names == ["vehicle.b.truck", "vehicle.a.car", "vehicle.a.car"]


def test_a_class_that_the_server_lacks_is_refused_with_the_group(spec: EpisodeSpec) -> None:
    with pytest.raises(SceneError, match=r"vehicles\.groups\[0\]\.filter: .* base_type bus"):
        spawn(spec, GroupSpec(1, "vehicle.*", "bus"), GroupSpec(1, "vehicle.*"))


def test_a_shortfall_is_warned_of_by_default(
    spec: EpisodeSpec, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        assert len(spawn(spec, GroupSpec(9, "vehicle.*"))) == 3
    assert "only 3 of 9 vehicles" in caplog.text


def test_a_shortfall_is_an_error_where_it_shall_be(spec: EpisodeSpec) -> None:
    with pytest.raises(SceneError, match=r"vehicles\.count: only 3 of 9") as caught:
        spawn(spec, GroupSpec(9, "vehicle.*"), shortfall="fail")
    assert "vehicles.shortfall" in caught.value.hint


def test_places_between_the_spawn_points_fill_a_shortfall(spec: EpisodeSpec) -> None:
    xs = [x for _, x in spawn(spec, GroupSpec(5, "vehicle.*"), shortfall="fill")]
    assert sorted(xs[3:]) == [10.0, 30.0]
    with pytest.raises(SceneError, match="only 5 of 6"):
        spawn(spec, GroupSpec(6, "vehicle.*"), shortfall="fill")
