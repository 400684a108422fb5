from __future__ import annotations

import struct

from hypothesis import given
from hypothesis import strategies as st

from carstage_sim.labels import CityObjectLabel
from carstage_sim.wire import values
from carstage_sim.wire.dialect import dialect
from carstage_sim.wire.token import stream_token
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


def test_parts_of_the_town_are_actors_without_an_id_named_by_their_label() -> None:
    actor = values.encode_scenery(CityObjectLabel.BUILDINGS, dialect("0.9.16"))
    assert actor[0] == 0
    assert actor[2] == [0, "static.building", []]
    assert actor[4:] == [bytes([CityObjectLabel.BUILDINGS]), b""]
    older = values.encode_scenery(CityObjectLabel.BUILDINGS, dialect("0.9.13"))
    assert older[4] == bytes([1])
    for label, name in ((CityObjectLabel.GUARD_RAIL, "guardrail"), (0, "unknown")):
        assert values.encode_scenery(label, dialect("0.9.16"))[2][1] == f"static.{name}"
