from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from carstage_sim.wire import values
from carstage_sim.wire.dialect import DIALECTS, dialect
from carstage_sim.wire.errors import UnknownProtocolError
from carstage_sim.wire.token import stream_token
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.controls import EpisodeSettings
from carstage_sim.world.pose import Pose
from carstage_sim.world.state import Weather

numbers = st.floats(-1e6, 1e6)
vectors = st.tuples(numbers, numbers, numbers)


@given(vectors, vectors)
def test_pose_survives_the_wire(location: values.Vector3, rotation: values.Vector3) -> None:
    pose = Pose(location, rotation)
    assert values.pose(values.encode_pose(pose)) == pose


@given(st.one_of(st.none(), st.floats(0.001, 1.0)), st.booleans(), st.integers(1, 16))
def test_settings_survive_the_wire(delta: float | None, sync: bool, substeps: int) -> None:
    settings = EpisodeSettings(sync, fixed_delta_seconds=delta, max_substeps=substeps)
    assert values.settings(values.encode_settings(settings)) == settings


def test_settings_of_older_clients_keep_the_defaults_of_what_they_lack() -> None:
    short = values.encode_settings(EpisodeSettings(synchronous_mode=True))[:10]
    assert values.settings(short) == EpisodeSettings(synchronous_mode=True)


def test_weather_survives_the_wire_in_both_lengths() -> None:
    weather = Weather(*(float(number) for number in range(14)))
    encoded = values.encode_weather(weather)
    assert values.weather(encoded) == weather
    assert values.weather(encoded[:13]) == Weather(*(float(number) for number in range(13)))


def test_token_is_24_bytes_and_leaves_the_address_to_the_client() -> None:
    token = stream_token(9, 2001)
    assert struct.unpack("<IHBB16s", token) == (9, 2001, 1, 0, bytes(16))


def test_registry_of_0_9_16_numbers_messages_as_the_client_does() -> None:
    table = dialect("0.9.16")
    assert table.world_observer == 17
    indices = {name: table.sensors.index(name) for name in table.sensors}
    assert indices["sensor.camera.depth"] == 1
    assert indices["sensor.other.gnss"] == 4
    assert indices["sensor.other.imu"] == 5
    assert indices["sensor.lidar.ray_cast"] == 11
    assert indices["sensor.camera.rgb"] == 13
    assert indices["sensor.camera.instance_segmentation"] == 15
    assert len(table.sensors) == 22
    assert len(table.commands) == 22


@pytest.mark.parametrize("version", sorted(DIALECTS))
def test_every_sensor_of_the_library_has_a_number(version: str) -> None:
    sensors = {name for name in catalogue() if name.startswith("sensor.")}
    assert sensors <= set(dialect(version).sensors)


def test_attribute_types_begin_at_the_base_of_the_version() -> None:
    table = dialect("0.9.16")
    blueprint = catalogue()["vehicle.tesla.model3"]
    _, type_id, _, attributes = values.encode_definition(blueprint, table)
    kinds = {name: kind for name, kind, *_ in attributes}
    assert type_id == "vehicle.tesla.model3"
    assert (kinds["number_of_wheels"], kinds["role_name"], kinds["color"]) == (2, 4, 5)


def test_unknown_protocol_names_the_known_ones() -> None:
    with pytest.raises(UnknownProtocolError, match=r"0\.9\.16"):
        dialect("0.8.4")
