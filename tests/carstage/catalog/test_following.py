"""A catalog that is written beside a run: it neither delays the run nor ends it."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from benchmarks.framework.postgres_servers import PostgresServer
from carstage.catalog import Catalog, CatalogFollower, query_catalog, rebuild
from carstage.catalog.address import parse_address
from carstage.dataset import Dataset
from carstage.errors import BadInputError, CatalogError
from carstage.runs.cataloguing import run_catalog
from small_episodes import add_episode
from waiting import await_that

pytestmark = pytest.mark.xdist_group("postgres")

FIRST, SECOND = "00000000000000f1", "00000000000000f2"
COUNT = "SELECT count(*) AS n FROM episodes"


def recorded(catalog: Catalog) -> int:
    return int(query_catalog(catalog, COUNT).to_pylist()[0]["n"])


def test_what_is_committed_is_in_the_catalog_with_its_run(tmp_path: Path) -> None:
    address, notices = parse_address(str(tmp_path / "c.sqlite"), secret=False), list[str]()
    with CatalogFollower(address, tmp_path / "out", notices.append) as follower:
        for episode_id in (FIRST, SECOND):
            add_episode(tmp_path / "out", episode_id)
            follower.committed(episode_id, "the-run")
        follower.ended({"run_id": "the-run", "state": "done", "committed": 2})
    assert notices == []
    with Catalog(address) as catalog:
        found = query_catalog(catalog, "SELECT e.run_id, r.state FROM episodes e "
                              "JOIN runs r ON r.run_id = e.run_id")  # fmt: skip
        assert found.to_pylist() == [{"run_id": "the-run", "state": "done"}] * 2


@pytest.mark.parametrize("which", ["wheel_postgres", "debian_postgres"])
def test_it_goes_on_when_the_database_was_started_again(
    which: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    server: PostgresServer = request.getfixturevalue(which)
    server.create("catalog")
    address, notices = parse_address(server.good_address, secret=True), list[str]()
    with CatalogFollower(address, tmp_path / "out", notices.append) as follower:
        add_episode(tmp_path / "out", FIRST)
        follower.committed(FIRST, "run")
        with Catalog(address) as catalog:
            await_that(lambda: recorded(catalog) == 1)
        server.stop()
        try:
            add_episode(tmp_path / "out", SECOND)
            begin_s = time.monotonic()
            follower.committed(SECOND, "run")
            assert time.monotonic() - begin_s < 1.0  # the run does not wait
        finally:
            server.start()
        with Catalog(address) as catalog:
            await_that(lambda: recorded(catalog) == 2)
    assert notices == []


def test_a_database_that_stays_away_becomes_one_notice(
    wheel_postgres: PostgresServer, tmp_path: Path
) -> None:
    wheel_postgres.create("catalog")
    address, notices = parse_address(wheel_postgres.good_address, secret=True), list[str]()
    try:
        with CatalogFollower(address, tmp_path / "out", notices.append) as follower:
            wheel_postgres.stop()
            for episode_id in (FIRST, SECOND):
                add_episode(tmp_path / "out", episode_id)
                follower.committed(episode_id, "run")
            begin_s = time.monotonic()
        assert time.monotonic() - begin_s < 10.0
    finally:
        wheel_postgres.start()
    (notice,) = notices
    assert notice.startswith("2 committed episodes are not in the catalog postgresql://")
    assert "carstage catalog rebuild" in notice
    assert "p&ss" not in notice
    with Catalog(address) as catalog:
        rebuild(catalog, Dataset(tmp_path / "out"), update=True)
        assert recorded(catalog) == 2


def test_an_episode_that_cannot_be_read_is_told_and_the_next_one_is_written(
    tmp_path: Path,
) -> None:
    address, notices = parse_address(str(tmp_path / "c.sqlite"), secret=False), list[str]()
    with CatalogFollower(address, tmp_path / "out", notices.append) as follower:
        add_episode(tmp_path / "out", FIRST)
        (tmp_path / "out" / "episodes" / FIRST / "a1" / "objects.parquet").unlink()
        follower.committed(FIRST, "run")
        add_episode(tmp_path / "out", SECOND)
        follower.committed(SECOND, "run")
    (notice,) = notices
    assert notice.startswith("1 committed episode is not in the catalog")
    assert "objects.parquet" in notice
    with Catalog(address) as catalog:
        assert recorded(catalog) == 1


def test_a_catalog_that_cannot_be_opened_ends_a_run_before_it_begins(tmp_path: Path) -> None:
    with (
        pytest.raises(CatalogError, match="cannot be reached") as caught,
        run_catalog("postgresql://nobody@127.0.0.1:1/x", tmp_path, lambda sentence: None),
    ):
        pytest.fail("the run began")
    assert caught.value.exit_code == 2
    with (
        pytest.raises(BadInputError),
        run_catalog("mysql://h/x", tmp_path, lambda sentence: None),
    ):
        pytest.fail("the run began")


def test_without_a_catalog_events_go_where_they_went(tmp_path: Path) -> None:
    def on_event(event: object) -> None: ...

    with run_catalog(None, tmp_path, lambda sentence: None) as follow:
        assert follow(on_event, None) is on_event  # type: ignore[arg-type]
