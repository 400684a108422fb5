"""Golden test B1 and section 20: which box an actor gets, and which class."""

from __future__ import annotations

import numpy as np
import pytest

from annotation_scenes import actor
from carstage.annotation.boxes import MeasuredBox, label_box
from carstage.annotation.classes import object_class

BIKE = "vehicle.bh.crossbike"
BIKE_ATTRIBUTES = {"base_type": "bicycle", "number_of_wheels": "2"}
UNUSABLE = [
    (0.8, 0.0, 0.7),
    (np.inf, 0.4, 0.7),
    (250.0, 250.0, 250.0),
    (0.0, 0.0, 0.0),
    (0.8, 0.1, 0.7),
    (np.nan, 0.4, 0.7),
]


@pytest.mark.parametrize("extent", UNUSABLE)
def test_unusable_boxes_of_two_wheelers_are_rejected(extent: tuple[float, ...]) -> None:
    bike = actor(1, BIKE, extent=extent, attributes=BIKE_ATTRIBUTES)
    box = label_box(bike, "bicycle", {})
    assert box.source == "invalid"
    assert not box.valid


@pytest.mark.parametrize("extent", [*UNUSABLE, (0.8, 0.4, 0.7)])
def test_measured_boxes_replace_those_of_two_wheelers(extent: tuple[float, ...]) -> None:
    measured = {BIKE: MeasuredBox((0.0, 0.0, 0.85), (0.85, 0.35, 0.85))}
    bike = actor(1, BIKE, extent=extent, attributes=BIKE_ATTRIBUTES)
    box = label_box(bike, "bicycle", measured)
    assert box.source == "measured"
    assert box.extent.tolist() == [0.85, 0.35, 0.85]
    assert box.location.tolist() == [0.0, 0.0, 0.85]


def test_a_plausible_two_wheeler_keeps_its_box() -> None:
    bike = actor(1, BIKE, extent=(0.8, 0.4, 0.7), attributes=BIKE_ATTRIBUTES)
    assert label_box(bike, "bicycle", {}).source == "actor"


def test_thin_boxes_are_refused_to_two_wheelers_only() -> None:
    thin = (0.8, 0.1, 0.7)
    assert label_box(actor(1, extent=thin), "car", {}).valid
    assert not label_box(actor(1, extent=thin), "motorcycle", {}).valid


@pytest.mark.parametrize(
    "box", [{"location": (16.0, 0, 0)}, {"extent": (15.1, 1, 1)}, {"extent": (2, 0.04, 1)}]
)
def test_impossible_sizes_and_offsets_are_rejected(box: dict[str, tuple[float, ...]]) -> None:
    assert label_box(actor(1, **box), "car", {}).source == "invalid"


@pytest.mark.parametrize(
    ("location", "extent", "source"),
    [
        ((0, 0, 0), (0.19, 0.19, 0.93), "capsule"),
        ((0, 0, 0.05), (0.19, 0.19, 0.93), "mesh"),
        ((0, 0, 0), (0.3, 0.4, 0.93), "mesh"),
    ],
)
def test_walker_capsules_are_told_from_mesh_bounds(
    location: tuple[float, ...], extent: tuple[float, ...], source: str
) -> None:
    walker = actor(2, "walker.pedestrian.0001", location=location, extent=extent, attributes={})
    assert label_box(walker, "walker_adult", {}).source == source


@pytest.mark.parametrize(
    ("type_id", "attributes", "expected"),
    [
        ("vehicle.audi.a2", {"base_type": "car"}, "car"),
        ("vehicle.ford.ambulance", {"base_type": "van", "special_type": "emergency"}, "van"),
        ("vehicle.mitsubishi.fusorosa", {"base_type": "Bus"}, "bus"),
        ("vehicle.bh.crossbike", {"number_of_wheels": "2"}, "bicycle"),
        ("vehicle.unknown.scooter", {"number_of_wheels": "2"}, "motorcycle"),
        ("vehicle.carlamotors.firetruck", {}, "truck"),
        ("vehicle.unknown.thing", {"number_of_wheels": "4"}, "car"),
        ("walker.pedestrian.0001", {"age": "adult"}, "walker_adult"),
        ("walker.pedestrian.0009", {"age": "child"}, "walker_child"),
        ("walker.pedestrian.0050", {"use_wheelchair": "true"}, "walker_wheelchair"),
        ("sensor.camera.rgb", {}, None),
        ("traffic.traffic_light", {}, None),
        ("controller.ai.walker", {}, None),
    ],
)
def test_classes_follow_from_the_blueprint(
    type_id: str, attributes: dict[str, str], expected: str | None
) -> None:
    assert object_class(actor(1, type_id, attributes=attributes)) == expected
