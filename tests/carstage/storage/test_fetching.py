"""What is fetched ahead is in the cache, and read without asking the store again."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from carstage.files.bounded import read_bounded
from carstage.storage.fetching import fetched_ahead
from carstage.storage.object_cache import CACHE_BYTES_VARIABLE
from carstage.storage.remote_files import RemoteFiles, remote_files
from carstage.storage.remote_path import RemotePath
from driving import wait_for
from object_stores import localbucket

NAMES = [f"episodes/e/a1/sensors/CAM/{number:06}.png" for number in range(40)]


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RemoteFiles]:
    with localbucket(tmp_path / "server") as server:
        for name, value in server.environment.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setenv("CARSTAGE_CACHE_DIR", str(tmp_path / "cache"))
        remote_files.cache_clear()
        made = remote_files(f"{server.address}/{tmp_path.name}")
        for name in NAMES:
            made.write(name, name.encode())
        yield made
    remote_files.cache_clear()


def cached(tmp_path: Path) -> int:
    folder = tmp_path / "cache" / "objects"
    return sum(not path.name.startswith(".") for path in folder.glob("*/*"))


def test_files_are_there_before_they_are_read(files: RemoteFiles, tmp_path: Path) -> None:
    paths = [RemotePath(files.root, name) for name in (*NAMES, "episodes/e/a1/missing.png")]
    with fetched_ahead([(path, 100) for path in paths]):
        wait_for(lambda: cached(tmp_path) == len(NAMES), "the files in the cache")
    files.delete(NAMES)
    for path in paths[:-1]:
        assert read_bounded(path) == path.key.encode()
    with pytest.raises(FileNotFoundError):
        read_bounded(paths[-1])


def test_what_the_cache_could_not_keep_is_not_fetched(
    files: RemoteFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CACHE_BYTES_VARIABLE, "1")
    paths = [RemotePath(files.root, name) for name in NAMES]
    with fetched_ahead([(path, 10_000) for path in paths]):
        assert read_bounded(paths[-1]) == NAMES[-1].encode()
    assert cached(tmp_path) == 1


def test_files_of_this_machine_are_left_alone(tmp_path: Path) -> None:
    with fetched_ahead([(tmp_path / "nothing", 1)]):
        assert not (tmp_path / "nothing").exists()
