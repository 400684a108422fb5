from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.describe.offers import describe
from carstage_sim.labels import CityObjectLabel
from carstage_sim.sensors.measurements import SEMANTIC_POINT, ImageFrame, SemanticLidarFrame
from carstage_sim.wire import values
from carstage_sim.wire.dialect import DIALECTS, dialect
from carstage_sim.wire.dialect_tables import LABELS_0_9_13
from carstage_sim.wire.errors import UnknownProtocolError
from carstage_sim.wire.handlers import known_calls
from carstage_sim.wire.relabelling import Relabelling
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.blueprints.sensors import sent_as

VERSIONS = sorted(DIALECTS)

# Numbers of the sensor registries, as the debug information of each wheel has them.
REGISTRY = {
    "0.9.13": {"depth": 1, "dvs": 2, "rgb": 12, "instance": 14, "world": 15, "entries": 16},
    "0.9.14": {"depth": 1, "dvs": 3, "rgb": 13, "instance": 15, "world": 16, "entries": 19},
    "0.9.15": {"depth": 1, "dvs": 3, "rgb": 13, "instance": 15, "world": 16, "entries": 19},
    "0.9.16": {"depth": 1, "dvs": 3, "rgb": 13, "instance": 15, "world": 17, "entries": 22},
}
COMMANDS = {
    "0.9.13": (18, {"ApplyWalkerControl": 3, "SetAutopilot": 15, "SetVehicleLightState": 17}),
    "0.9.14": (22, {"ApplyWalkerControl": 4, "SetAutopilot": 16, "SetVehicleLightState": 18}),
    "0.9.15": (22, {"ApplyWalkerControl": 4, "SetAutopilot": 16, "SetVehicleLightState": 18}),
    "0.9.16": (22, {"ApplyWalkerControl": 4, "SetAutopilot": 16, "SetVehicleLightState": 18}),
}


@pytest.mark.parametrize("version", VERSIONS)
def test_registry_numbers_messages_as_the_client_does(version: str) -> None:
    sensors = dialect(version).sensors
    found = {
        "depth": sensors.index("sensor.camera.depth"),
        "dvs": sensors.index("sensor.camera.dvs"),
        "rgb": sensors.index("sensor.camera.rgb"),
        "instance": sensors.index("sensor.camera.instance_segmentation"),
        "world": dialect(version).world_observer,
        "entries": len(sensors),
    }
    assert found == REGISTRY[version]


@pytest.mark.parametrize("version", VERSIONS)
def test_commands_are_numbered_as_the_client_does(version: str) -> None:
    commands = dialect(version).commands
    count, numbers = COMMANDS[version]
    assert (len(commands), {name: commands.index(name) for name in numbers}) == (count, numbers)


@pytest.mark.parametrize("version", VERSIONS)
def test_every_sensor_that_is_offered_has_a_number(version: str) -> None:
    offered = {blueprint["id"] for blueprint in describe(version)["blueprints"]}
    sensors = {name for name in offered if name.startswith("sensor.")}
    assert "sensor.camera.rgb" in sensors
    assert {sent_as(name) for name in sensors} <= set(dialect(version).sensors)


def test_empty_actor_is_offered_since_0_9_15() -> None:
    offered = {version: spoken.offers("util.actor.empty") for version, spoken in DIALECTS.items()}
    assert offered == {"0.9.13": False, "0.9.14": False, "0.9.15": True, "0.9.16": True}


def test_normals_camera_is_offered_since_0_9_14() -> None:
    offering = [v for v in VERSIONS if dialect(v).offers("sensor.camera.normals")]
    assert offering == ["0.9.14", "0.9.15", "0.9.16"]


@pytest.mark.parametrize("type_id", ["sensor.other.v2x", "sensor.other.v2x_custom"])
def test_v2x_sensors_are_offered_since_0_9_16(type_id: str) -> None:
    assert [v for v in VERSIONS if dialect(v).offers(type_id)] == ["0.9.16"]
    assert "send" not in dialect("0.9.16").missing_calls
    assert "send" in dialect("0.9.15").missing_calls


@pytest.mark.parametrize("version", VERSIONS)
def test_calls_that_a_version_lacks_are_calls_of_a_later_one(version: str) -> None:
    assert dialect(version).missing_calls <= known_calls()


@pytest.mark.parametrize(
    ("version", "base"), [("0.9.13", 0), ("0.9.14", 0), ("0.9.15", 0), ("0.9.16", 1)]
)
def test_attribute_types_begin_at_the_base_of_the_version(version: str, base: int) -> None:
    blueprint = catalogue()["vehicle.tesla.model3"]
    _, type_id, _, attributes = values.encode_definition(blueprint, dialect(version))
    kinds = {name: kind for name, kind, *_ in attributes}
    assert type_id == "vehicle.tesla.model3"
    assert [kinds[name] - base for name in ("number_of_wheels", "role_name", "color")] == [1, 3, 4]


def test_labels_of_0_9_13_are_all_there_and_nothing_else() -> None:
    spoken = dialect("0.9.13")
    assert {spoken.label(label) for label in CityObjectLabel} == {*range(23), 255}
    assert all(spoken.label(label) == 10 for label in range(14, 20))
    assert not any(dialect(version).labels for version in VERSIONS[1:])


@pytest.mark.parametrize("kind", ["semantic_segmentation", "instance_segmentation"])
def test_tags_of_a_picture_are_translated_and_its_ids_kept(kind: str) -> None:
    pixels = np.random.default_rng(1).integers(0, 29, (4, 5, 4), np.uint8)
    before = pixels.copy()
    frame = Relabelling(LABELS_0_9_13)(f"sensor.camera.{kind}", ImageFrame(90.0, pixels))
    assert isinstance(frame, ImageFrame)
    expected = np.vectorize(dialect("0.9.13").label)(before[..., 2])
    np.testing.assert_array_equal(frame.pixels[..., 2], expected)
    np.testing.assert_array_equal(frame.pixels[..., [0, 1, 3]], before[..., [0, 1, 3]])
    np.testing.assert_array_equal(pixels, before)  # another listener may have it


def test_tags_of_semantic_points_are_translated_and_the_rest_kept() -> None:
    points = np.zeros(3, SEMANTIC_POINT)
    points["x"], points["object_idx"] = (1.0, 2.0, 3.0), (7, 8, 9)
    points["object_tag"] = CityObjectLabel.ROADS, CityObjectLabel.CAR, CityObjectLabel.BUS
    before = SemanticLidarFrame(0.0, np.array([3], np.uint32), points)
    frame = Relabelling(LABELS_0_9_13)("sensor.lidar.ray_cast_semantic", before)
    assert isinstance(frame, SemanticLidarFrame)
    assert frame.points["object_tag"].tolist() == [7, 10, 10]
    assert frame.points["x"].tolist() == [1.0, 2.0, 3.0]
    assert frame.points["object_idx"].tolist() == [7, 8, 9]
    assert points["object_tag"].tolist() == [1, 14, 16]


def test_pictures_without_tags_leave_as_they_are() -> None:
    frame = ImageFrame(90.0, np.full((2, 2, 4), 14, np.uint8))
    assert Relabelling(LABELS_0_9_13)("sensor.camera.rgb", frame) is frame
    assert Relabelling(LABELS_0_9_13)("sensor.lidar.ray_cast_sweeping", frame) is frame
    assert Relabelling({})("sensor.camera.semantic_segmentation", frame) is frame


def test_unknown_protocol_names_the_known_ones() -> None:
    with pytest.raises(UnknownProtocolError, match=r"0\.9\.13, 0\.9\.14, 0\.9\.15, 0\.9\.16"):
        dialect("0.8.4")
