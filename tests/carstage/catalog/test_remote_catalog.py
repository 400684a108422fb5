"""A catalog of a dataset in an object store, on a real S3 server."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from carstage.cache import CACHE_VARIABLE
from carstage.catalog import (
    Catalog,
    CatalogFollower,
    PageFilter,
    catalog_address,
    collect,
    leftovers,
    list_episodes,
    query_labels,
    rebuild,
    verify,
)
from carstage.catalog.address import location_of
from carstage.dataset import Dataset
from carstage.runs import held_attempts, work_folder
from carstage.storage import RemotePath, open_store
from carstage.storage.remote_files import remote_files
from object_stores import ObjectServer, moto
from small_episodes import add_episode

CLEAR, WET, NIGHT = "00000000000000c1", "00000000000000c2", "00000000000000c3"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ObjectServer]:
    with moto(tmp_path_factory.mktemp("moto")) as running:
        yield running


@pytest.fixture
def remote(
    server: ObjectServer, small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> RemotePath:
    """The small dataset, and an attempt that a marker has overtaken, in a bucket."""
    for name, value in server.environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    remote_files.cache_clear()
    add_episode(small, WET, attempt="a2", commit=False)
    root = RemotePath(f"{server.address}/{tmp_path.name}")
    for path in small.rglob("*"):
        if path.is_file():
            (root / path.relative_to(small).as_posix()).write_bytes(path.read_bytes())
    return root


def test_it_lists_asks_and_verifies_as_of_a_folder(remote: RemotePath) -> None:
    dataset = Dataset(remote)
    address = catalog_address(None, dataset.path)
    location = location_of(dataset.path, address)
    assert location == remote.root
    with Catalog(address) as catalog:
        assert rebuild(catalog, dataset).to_json()["written"] == 3
        page = list_episodes(catalog, location, PageFilter(sensor="lidar"))
        assert [row["episode_id"] for row in page.episodes] == [WET]
        assert list(verify(catalog, dataset, deep=True)) == []
        query = "SELECT class, count(*) AS n FROM objects WHERE NOT is_ego GROUP BY 1 ORDER BY 1"
        answer = query_labels(dataset, query, catalog=catalog, wanted=PageFilter(town="Stage02"))
    assert answer.table.to_pylist() == [
        {"class": "car", "n": 4},
        {"class": "walker_adult", "n": 20},
    ]
    assert answer.files == 1
    assert answer.bytes_read is not None
    assert 0 < answer.bytes_read < 100_000


def test_a_condition_on_the_episode_leaves_the_other_objects_alone(remote: RemotePath) -> None:
    whole = query_labels(Dataset(remote), "SELECT sum(distance_ego) FROM objects")
    one = "SELECT sum(distance_ego) FROM objects WHERE episode_id = '00000000000000c1'"
    some = query_labels(Dataset(remote), one)
    assert some.bytes_read is not None
    assert whole.bytes_read is not None
    assert some.bytes_read < whole.bytes_read
    assert Dataset(remote).sql("SELECT count(*) AS n FROM ego").to_pylist() == [{"n": 12}]


def test_what_is_left_over_is_removed(remote: RemotePath) -> None:
    store = open_store(remote)
    held = held_attempts(work_folder(remote, None), store)
    found = list(leftovers(store, held=held))
    assert [(one.episode_id, one.attempt, one.files) for one in found] == [(WET, "a2", 4)]
    assert found[0].age_s < 3600.0
    assert collect(store, found) == {}
    assert sorted(store.attempts()) == [(CLEAR, "a1"), (WET, "a1"), (NIGHT, "a1")]


def test_a_run_beside_writes_what_is_committed_there(remote: RemotePath, tmp_path: Path) -> None:
    notices = list[str]()
    address = catalog_address(str(tmp_path / "beside.sqlite"))
    with CatalogFollower(address, remote, notices.append) as follower:
        follower.committed(NIGHT, "the-run")
    assert notices == []
    with Catalog(address) as catalog:
        (row,) = list_episodes(catalog, remote.root).episodes
    assert (row["episode_id"], row["run_id"], row["weather"]) == (NIGHT, "the-run", "ClearNight")
