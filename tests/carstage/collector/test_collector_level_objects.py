"""What is recorded of a level: its boxes in one order, and which light a head belongs to."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, get_args

import pytest

pytest.importorskip("carla")

import carla

from carstage.collector.internals.dialect import city_object_labels
from carstage.collector.internals.level_objects import level_objects
from carstage.config.labels import LevelObjectKind
from carstage.spec import Fields, LabelsSpec, SpecError
from carstage.spec.labels import LEVEL_OBJECTS

LABELS = carla.CityObjectLabel


def box(x: float) -> Any:
    return carla.BoundingBox(carla.Location(x, 2.0, 3.0), carla.Vector3D(1.0, 0.5, 0.25))


def piece(number: int, label: Any, x: float) -> Any:
    return SimpleNamespace(id=number, name=f"Piece_{number}", type=label, bounding_box=box(x))


def light(actor_id: int, *heads: float) -> Any:
    return SimpleNamespace(id=actor_id, get_light_boxes=lambda: [box(x) for x in heads])


class World:
    """A level of a few pieces, and two lights with two heads each."""

    def __init__(self) -> None:
        self.asked: list[Any] = []
        self.pieces = {
            LABELS.Car: [piece(2**63 + 1, LABELS.Car, 0.0), piece(4, LABELS.Car, 1.0)],
            LABELS.TrafficLight: [piece(7, LABELS.TrafficLight, x) for x in (10.0, 20.2, 50.0)],
        }

    def get_environment_objects(self, label: Any) -> list[Any]:
        self.asked.append(label)
        return self.pieces.get(label, [])

    def get_actors(self) -> Any:
        lights = [light(31, 20.0, 80.0), light(30, 10.0, 20.9)]
        return SimpleNamespace(filter=lambda pattern: lights)


def test_objects_are_told_by_label_and_id() -> None:
    rows = level_objects(World(), ("traffic_lights", "parked_vehicles"))
    assert [(row["label"], row["id"]) for row in rows][3:] == [(14, 4), (14, 2**63 + 1)]
    assert rows[3]["box"] == {
        "location": [1.0, 2.0, 3.0], "extent": [1.0, 0.5, 0.25], "rotation_deg": [0.0, 0.0, 0.0],
    }  # fmt: skip


def test_a_head_belongs_to_the_light_with_the_nearest_box() -> None:
    rows = level_objects(World(), ("traffic_lights",))
    lights = {round(row["box"]["location"][0], 1): row["light"] for row in rows}
    assert lights == {10.0: 30, 20.2: 31, 50.0: 0}


def test_nothing_is_asked_of_the_server_for_nothing() -> None:
    world = World()
    assert level_objects(world, ()) == []
    assert world.asked == []


def test_the_configuration_offers_what_the_collector_knows() -> None:
    assert sorted(get_args(LevelObjectKind)) == sorted(LEVEL_OBJECTS)
    assert all(city_object_labels(name) for name in LEVEL_OBJECTS)


def test_an_unknown_kind_is_refused_with_its_place() -> None:
    labels = Fields({"level_objects": ["poles", "pole"]}, "spec.labels")
    with pytest.raises(SpecError, match=r"spec\.labels\.level_objects\[1\]: 'pole'"):
        LabelsSpec.read(labels)
