"""The vector map of a town is made once per machine, and never another than it would be anew."""

from __future__ import annotations

from pathlib import Path

import pytest

import analytic_scene
from carstage.cache import CACHE_VARIABLE
from carstage.conversion import town as towns
from carstage.conversion.town import Town, make_vector_map
from carstage.files.hashing import hash_of


@pytest.fixture(scope="module")
def raw(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scene") / "raw"
    analytic_scene.write_raw_log(folder)
    return folder


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    return tmp_path / "vector-maps"


class Making:
    """Stands in for the making of a map, and counts."""

    def __init__(self, town: Town) -> None:
        self.town = town
        self.times = 0

    def __call__(self, *_: object) -> Town:
        self.times += 1
        return self.town


@pytest.fixture
def making(monkeypatch: pytest.MonkeyPatch, cache: Path) -> Making:
    made = Making(Town(b"line\nof a map"))
    monkeypatch.setattr(towns, "_made", made)
    return made


def test_a_map_is_made_once_and_has_the_same_bytes(raw: Path, making: Making) -> None:
    assert make_vector_map(raw) == make_vector_map(raw) == making.town
    assert making.times == 1


@pytest.mark.parametrize("damaged", [b"", b"line\nof a map", b"blake3:00\nline\nof a map"])
def test_a_damaged_map_is_made_again(
    raw: Path, making: Making, cache: Path, damaged: bytes
) -> None:
    make_vector_map(raw)
    (kept,) = cache.iterdir()
    kept.write_bytes(damaged)
    assert make_vector_map(raw) == making.town
    assert making.times == 2
    assert kept.read_bytes() == hash_of(b"line\nof a map").encode() + b"\nline\nof a map"


def test_another_code_makes_it_again(
    raw: Path, making: Making, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_vector_map(raw)
    monkeypatch.setattr(towns, "_SOURCES", ("vector_map",))
    make_vector_map(raw)
    assert making.times == 2


def test_a_text_that_no_map_can_be_made_of_is_read_each_time(
    raw: Path, making: Making, cache: Path
) -> None:
    making.town = Town(problem="no road")
    assert make_vector_map(raw) == make_vector_map(raw) == making.town
    assert making.times == 2
    assert not cache.exists()


def test_a_cache_that_cannot_be_written_changes_nothing(
    raw: Path, making: Making, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_bytes(b"")
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "file"))
    assert make_vector_map(raw) == making.town
