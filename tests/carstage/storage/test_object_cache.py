"""The local cache of objects: bounded, and never in the way of who reads."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from carstage.cache import CACHE_VARIABLE
from carstage.files.bounded import read_bounded
from carstage.storage import RemotePath, object_cache
from carstage.storage.remote_path import RemoteStat


class Objects:
    """Objects in memory that count how often they are read."""

    def __init__(self, **contents: bytes) -> None:
        self.contents = {name.replace("__", "/"): content for name, content in contents.items()}
        self.reads = 0

    def read_into(self, key: str, path: Path, most_bytes: int) -> None:
        self.reads += 1
        if key not in self.contents:
            raise FileNotFoundError(2, "No such object", key)
        path.write_bytes(self.contents[key][: most_bytes + 1])

    def stat(self, key: str) -> RemoteStat:
        return RemoteStat(len(self.contents[key]), 0.0)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    monkeypatch.setattr(object_cache, "_fetched_bytes", 0)
    return tmp_path / "objects"


def read(key: str, objects: Any, root: str = "s3://bucket/x") -> bytes:
    descriptor = object_cache.open_copy(RemotePath(root, key), objects, 1 << 20)
    with os.fdopen(descriptor, "rb") as file:
        return file.read()


def test_a_file_of_an_episode_is_fetched_once(cache: Path) -> None:
    objects = Objects(episodes__e__a1__f=b"abc")
    assert [read("episodes/e/a1/f", objects) for _ in range(3)] == [b"abc"] * 3
    assert objects.reads == 1


def test_copies_of_a_removed_dataset_are_forgotten_and_those_of_others_are_not(cache: Path) -> None:
    objects = Objects(episodes__e=b"abc")
    for root in ("s3://bucket/x", "s3://bucket/y"):
        assert read("episodes/e", objects, root) == b"abc"
    objects.contents["episodes/e"] = b"new"
    object_cache.forget_copies("s3://bucket/x")
    assert read("episodes/e", objects, "s3://bucket/x") == b"new"
    assert read("episodes/e", objects, "s3://bucket/y") == b"abc"


def test_what_may_change_is_fetched_again_once_it_has(cache: Path) -> None:
    objects = Objects(splits=b"abc")
    assert read("splits", objects) == b"abc"
    objects.contents["splits"] = b"abcd"
    assert read("splits", objects) == b"abcd"


def test_the_cache_keeps_within_its_bound_and_what_was_used_last(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(object_cache.CACHE_BYTES_VARIABLE, "0.1")
    objects = Objects(**{f"episodes__{number}": bytes(10_000) for number in range(40)})
    for number in range(40):
        assert len(read(f"episodes/{number}", objects)) == 10_000
        read("episodes/0", objects)
    left = list(cache.glob("*/*"))
    assert 0 < sum(path.stat().st_size for path in left) <= 200_000
    assert not [path for path in left if path.name.startswith(".")]


def test_what_is_open_can_be_read_when_it_is_pushed_out(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(object_cache.CACHE_BYTES_VARIABLE, "0.000001")  # nothing has room
    assert read("episodes/1", Objects(episodes__1=b"abc")) == b"abc"
    assert list(cache.glob("*/*")) == []


def test_what_others_are_writing_stays_and_what_they_left_goes(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(object_cache.CACHE_BYTES_VARIABLE, "0.000001")
    written, left = cache / "00" / ".one", cache / "00" / ".other"
    written.parent.mkdir(parents=True)
    written.write_bytes(b"half")
    left.write_bytes(b"half")
    os.utime(left, (0.0, 0.0))
    assert read("episodes/1", Objects(episodes__1=b"abc")) == b"abc"
    assert [path for path in cache.glob("*/*") if path.is_file()] == [written]


def test_an_object_that_is_not_there_leaves_nothing(cache: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read("episodes/1", Objects())
    assert list(cache.glob("*/*")) == []


def test_readers_take_it_like_a_file(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    objects = Objects(episodes__1=b"abc")
    monkeypatch.setattr("carstage.storage.remote_files.remote_files", lambda root: objects)
    assert read_bounded(RemotePath("s3://bucket/x") / "episodes/1") == b"abc"
