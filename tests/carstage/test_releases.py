"""Which servers can be recorded from, and with which client."""

from __future__ import annotations

import pytest

from carstage.releases import (
    CLIENT_PYTHONS,
    KNOWN,
    Release,
    client_release,
    is_newer,
    refusal,
    release_of,
)
from carstage.sensor_kinds import sensor_kind

_SINCE = {kind: sensor_kind(kind).since for kind in ("rgb", "normals")}


@pytest.mark.parametrize(
    ("text", "release"),
    [
        ("0.9.16", Release(0, 9, 16)),
        ("0.9.15-dirty", Release(0, 9, 15)),
        ("0.9.14-12-gabc", Release(0, 9, 14)),
        ("unknown", None),
    ],
)
def test_release_is_read_from_what_servers_report(text: str, release: Release | None) -> None:
    assert release_of(text) == release


def test_server_older_than_the_oldest_known_is_refused_with_both_versions() -> None:
    assert "0.9.12" in refusal("0.9.12")
    assert "0.9.13" in refusal("0.9.12")
    assert refusal("0.9.13") == refusal("0.9.16") == refusal("0.10.0") == ""


def test_kind_of_sensor_that_a_release_lacks_is_refused_with_both_versions() -> None:
    assert refusal("0.9.14", _SINCE) == ""
    found = refusal("0.9.13", _SINCE)
    assert all(word in found for word in ("normals", "0.9.13", "0.9.14"))


def test_text_that_is_no_version_is_refused() -> None:
    assert "'main'" in refusal("main")


def test_newer_server_gets_the_newest_known_client() -> None:
    assert is_newer("0.9.17")
    assert is_newer("0.10.0")
    assert not is_newer("0.9.16-dirty")
    assert client_release("0.10.0") == KNOWN[-1]
    assert client_release("0.9.14") == Release(0, 9, 14)


def test_every_known_release_has_pythons() -> None:
    assert set(CLIENT_PYTHONS) == set(KNOWN)
