"""Commit markers of every format version are read."""

from __future__ import annotations

import json
from typing import Any

import pytest

from carstage.errors import DatasetError
from carstage.storage.marker import CommitMarker, FileEntry

_DIGEST = "0f" * 32


def _marker(version: int, **entry: Any) -> bytes:
    document = {
        "format_version": version,
        "episode_id": "e",
        "attempt": "a1",
        "frames": 1,
        "files": [{"path": "ego.parquet", "bytes": 3, **entry}],
        "versions": {},
        "self_test": None,
    }
    return json.dumps(document).encode()


def test_a_marker_of_version_1_has_sha256() -> None:
    marker = CommitMarker.from_bytes(_marker(1, sha256=_DIGEST), "e.json")
    assert marker.files == (FileEntry("ego.parquet", 3, f"sha256:{_DIGEST}"),)


def test_a_marker_is_read_as_it_was_written() -> None:
    marker = CommitMarker.from_bytes(_marker(2, hash=f"blake3:{_DIGEST}"), "e.json")
    assert marker.files[0].hash == f"blake3:{_DIGEST}"
    assert CommitMarker.from_bytes(marker.to_bytes(), "e.json") == marker


def test_an_unknown_algorithm_asks_for_a_newer_version() -> None:
    with pytest.raises(DatasetError, match="'md9'") as refusal:
        CommitMarker.from_bytes(_marker(2, hash=f"md9:{_DIGEST}"), "e.json")
    assert "newer" in str(refusal.value)


@pytest.mark.parametrize("entry", [{}, {"sha256": _DIGEST}, {"hash": "blake3:"}])
def test_an_entry_without_a_hash_is_damage(entry: dict[str, str]) -> None:
    with pytest.raises(DatasetError, match="damaged"):
        CommitMarker.from_bytes(_marker(2, **entry), "e.json")


@pytest.mark.parametrize("self_test", [[1], "ok", True])
def test_a_self_test_that_is_no_object_is_damage(self_test: object) -> None:
    document = json.loads(_marker(2, hash=f"blake3:{_DIGEST}"))
    document["self_test"] = self_test
    with pytest.raises(DatasetError, match="damaged"):
        CommitMarker.from_bytes(json.dumps(document).encode(), "e.json")
