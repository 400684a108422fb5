"""The library keeps what clients and the Traffic Manager rely on."""

from __future__ import annotations

import re

import pytest

from carstage_sim.content.people import POLICE
from carstage_sim.labels import CityObjectLabel
from carstage_sim.world.blueprints import AttributeType, Blueprint, catalogue
from carstage_sim.world.state import ActorKind

VEHICLES = [b for b in catalogue().values() if b.kind == ActorKind.VEHICLE]
WALKERS = [b for b in catalogue().values() if b.kind == ActorKind.WALKER]


def test_library_lists_the_families_that_the_simulator_produces() -> None:
    assert 40 <= len(VEHICLES) <= 45
    assert [b.id for b in WALKERS] == [f"walker.pedestrian.{n:04d}" for n in range(1, 51)]
    assert {b.id for b in catalogue().values() if b.kind == ActorKind.SENSOR} == {
        "sensor.camera.rgb",
        "sensor.camera.depth",
        "sensor.camera.dvs",
        "sensor.camera.semantic_segmentation",
        "sensor.camera.instance_segmentation",
        "sensor.camera.normals",
        "sensor.camera.optical_flow",
        "sensor.camera.cosmos_visualization",
        "sensor.lidar.ray_cast",
        "sensor.lidar.ray_cast_semantic",
        "sensor.lidar.ray_cast_sweeping",
        "sensor.lidar.ray_cast_flash",
        "sensor.other.imu",
        "sensor.other.gnss",
        "sensor.other.radar",
        "sensor.other.radar_rcs",
        "sensor.other.collision",
        "sensor.other.lane_invasion",
        "sensor.other.obstacle",
        "sensor.other.occupancy",
        "sensor.other.v2x",
        "sensor.other.v2x_custom",
    }
    assert "controller.ai.walker" in catalogue()
    assert {attribute.value for b in VEHICLES for attribute in b.attributes} >= {
        "car", "van", "truck", "bus", "motorcycle", "bicycle",
    }  # fmt: skip


def test_uids_are_unique_and_tags_are_the_ids_words() -> None:
    blueprints = list(catalogue().values())
    assert [b.uid for b in blueprints] == list(range(1, len(blueprints) + 1))
    assert all(b.tags == b.id.replace(".", ",") for b in blueprints)


def test_library_cannot_be_changed_by_its_readers() -> None:
    with pytest.raises(TypeError):
        catalogue()["vehicle.new"] = VEHICLES[0]  # type: ignore[index]


@pytest.mark.parametrize("blueprint", catalogue().values(), ids=lambda b: b.id)
def test_every_value_parses_as_its_type(blueprint: Blueprint) -> None:
    patterns = {
        AttributeType.BOOL: r"true|false",
        AttributeType.INT: r"-?\d+",
        AttributeType.FLOAT: r"-?\d+\.\d+",
        AttributeType.STRING: r".*",
        AttributeType.COLOR: r"\d{1,3},\d{1,3},\d{1,3}",
    }
    ids = [attribute.id for attribute in blueprint.attributes]
    assert len(ids) == len(set(ids))
    assert "role_name" in ids
    for attribute in blueprint.attributes:
        for value in (attribute.value, *attribute.recommended):
            assert re.fullmatch(patterns[attribute.type], value), attribute
        if attribute.recommended:
            assert attribute.value == attribute.recommended[0]
        else:
            assert not attribute.restrict


@pytest.mark.parametrize("blueprint", VEHICLES, ids=lambda b: b.id)
def test_vehicles_dimensions_agree_with_their_dynamics(blueprint: Blueprint) -> None:
    vehicle = blueprint.vehicle
    assert vehicle is not None
    half_length = blueprint.box_extent[0]
    assert blueprint.box_center[0] - half_length < vehicle.rear_axle_x_m < 0.0
    assert 0.0 < vehicle.front_axle_x_m < blueprint.box_center[0] + half_length
    assert 0.4 < vehicle.wheelbase_m / (2.0 * half_length) < 0.75
    assert vehicle.track_m <= 2.0 * blueprint.box_extent[1]
    assert abs(blueprint.box_center[2] - blueprint.box_extent[2]) < 0.2
    seen = {wheel.position_m for wheel in vehicle.wheels}
    assert len(seen) == int(blueprint.attribute("number_of_wheels").value)
    assert len(vehicle.wheels) == 4  # also of two-wheelers: programs for CARLA index them
    assert vehicle.max_steer_angle_deg == 70.0
    assert vehicle.max_deceleration * 0.7 >= 5.5


def test_semantic_tags_separate_riders_from_cars() -> None:
    tags = {b.id: b.semantic_tags for b in VEHICLES}
    assert tags["vehicle.bh.crossbike"] == (CityObjectLabel.BICYCLE, CityObjectLabel.RIDER)
    assert tags["vehicle.tesla.model3"] == (CityObjectLabel.CAR,)
    assert tags["vehicle.mitsubishi.fusorosa"] == (CityObjectLabel.BUS,)


def test_children_are_smaller_and_slower() -> None:
    child, adult = catalogue()["walker.pedestrian.0009"], catalogue()["walker.pedestrian.0001"]
    assert child.attribute("age").value == "child"
    assert child.box_extent[2] < adult.box_extent[2]
    assert float(child.attribute("speed").recommended[1]) < float(
        adult.attribute("speed").recommended[1]
    )


def test_an_unknown_attribute_is_named() -> None:
    with pytest.raises(KeyError, match=r"tesla\.model3.*wings"):
        catalogue()["vehicle.tesla.model3"].attribute("wings")


def test_wheelchairs_may_be_asked_for_on_every_walker_as_carlas_example_does() -> None:
    for walker in WALKERS:
        can = walker.attribute("can_use_wheelchair")
        assert not can.modifiable
        wish = walker.attribute("use_wheelchair")
        assert (wish.value, wish.modifiable, wish.restrict) == ("false", True, False)
        # Who cannot use one stays on foot whatever a script sets.
        assert wish.kept == (can.value == "true")
        assert wish.recommended == (("false", "true") if wish.kept else ("false",))


def test_most_grown_ups_can_use_a_wheelchair_children_and_police_cannot() -> None:
    can = {w.id for w in WALKERS if w.attribute("can_use_wheelchair").value == "true"}
    children = {w.id for w in WALKERS if w.attribute("age").value == "child"}
    police = {f"walker.pedestrian.{number:04d}" for number in POLICE}
    assert not can & (children | police)
    assert "walker.pedestrian.0028" in can  # the one of CARLA's page
    assert len(can) == 36
