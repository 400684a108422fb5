"""The differences between the clients' versions, without a server."""

from __future__ import annotations

import json
import subprocess

import carla
import pytest

from carstage.collector.internals.dialect import (
    attachment_type,
    check_versions,
    is_listening,
    weather_values,
)
from carstage.collector.internals.errors import VersionMismatchError
from carstage.collector.internals.needed_names import NEEDED
from client_wheels import wheel_python


class SensorWithProperty:
    """As a ``carla.Sensor`` of 0.9.13 tells it."""

    def __init__(self, listening: bool) -> None:
        self.is_listening = listening


class SensorWithMethod:
    """As a ``carla.Sensor`` since 0.9.14 tells it."""

    def __init__(self, listening: bool) -> None:
        self._listening = listening

    def is_listening(self) -> bool:
        return self._listening


@pytest.mark.parametrize("listening", [True, False])
def test_listening_is_known_of_old_and_new_sensors(listening: bool) -> None:
    assert is_listening(SensorWithProperty(listening)) is listening
    assert is_listening(SensorWithMethod(listening)) is listening


def test_attachment_that_the_client_lacks_is_none() -> None:
    assert attachment_type("Rigid") == carla.AttachmentType.Rigid
    assert attachment_type("Magnetic") is None


def test_weather_holds_what_the_client_has() -> None:
    found = weather_values(carla.WeatherParameters.ClearNoon, ("cloudiness", "aurora"))
    assert list(found) == ["cloudiness"]


def test_client_server_and_plan_of_one_release_go_together() -> None:
    check_versions("0.9.15", "0.9.15-dirty", ["0.9.15"])


@pytest.mark.parametrize(
    ("client", "server", "dialect"),
    [
        ("0.9.16", "0.9.15", "0.9.15"),
        ("0.9.13", "0.9.16", "0.9.16"),
        ("0.9.15", "0.10.0", "0.10.0"),
        ("0.9.16", "0.9.16", "0.9.15"),
    ],
)
def test_versions_that_differ_are_refused_and_both_named(
    client: str, server: str, dialect: str
) -> None:
    with pytest.raises(VersionMismatchError) as refused:
        check_versions(client, server, [dialect])
    assert server in str(refused.value)
    assert (client if client != server else dialect) in str(refused.value)


def test_server_older_than_the_oldest_known_is_refused_and_both_named() -> None:
    with pytest.raises(VersionMismatchError, match=r"0\.9\.16.*0\.9\.12.*0\.9\.13"):
        check_versions("0.9.16", "0.9.12", [])


def test_newest_known_client_goes_on_with_a_newer_server(
    caplog: pytest.LogCaptureFixture,
) -> None:
    check_versions("0.9.16", "0.10.0", ["0.10.0"])
    assert "0.10.0" in caplog.text


def test_a_newer_client_of_the_servers_own_release_goes_on_where_it_has_all_names() -> None:
    check_versions("0.9.17", "0.9.17", ["0.9.17"])


def test_a_newer_client_that_lacks_names_is_refused_in_a_sentence_that_lists_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delattr(carla.World, "spawn_actor")
    monkeypatch.delattr(carla, "WalkerControl")
    with pytest.raises(VersionMismatchError) as refused:
        check_versions("0.9.17", "0.9.17", [])
    lacks = "lacks carla.WalkerControl, carla.World.spawn_actor, which recording needs."
    assert refused.value.message == f"The carla wheel 0.9.17 {lacks}"
    assert "0.9.16" in refused.value.hint


_LACKING = """
import carla, json, sys
print([f"{owner}.{name}" for owner, names in json.loads(sys.argv[1]).items() for name in names
       if not hasattr(getattr(carla, owner, None), name)])
"""


@pytest.mark.parametrize("version", ["0.9.13", "0.9.14", "0.9.15", "0.9.16"])
def test_every_known_client_has_the_names_that_recording_needs(version: str) -> None:
    command = [wheel_python(version), "-c", _LACKING, json.dumps(NEEDED)]
    shown = subprocess.run(command, capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"
