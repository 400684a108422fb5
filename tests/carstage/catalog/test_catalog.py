"""What a catalog does, on SQLite and on two real PostgreSQL servers."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from benchmarks.framework.postgres_servers import PostgresServer
from carstage.catalog import (
    Catalog,
    CatalogAddress,
    PageFilter,
    list_episodes,
    load_labels,
    query_catalog,
    rebuild,
    record_episode,
    show_episode,
    verify,
)
from carstage.catalog.address import location_of, parse_address
from carstage.dataset import Dataset, SplitRule, split_dataset
from carstage.dataset.tables import write_table
from carstage.errors import BadInputError, CatalogError
from small_episodes import add_episode

CLEAR, WET, NIGHT = "00000000000000c1", "00000000000000c2", "00000000000000c3"
LATE = "00000000000000c4"

pytestmark = pytest.mark.xdist_group("postgres")


class CatalogTests:
    """The same for every kind of database; subclasses give the fixture ``address``."""

    @pytest.fixture
    def catalog(self, address: CatalogAddress) -> Iterator[Catalog]:
        with Catalog(address) as opened:
            yield opened

    @pytest.fixture
    def indexed(self, catalog: Catalog, small: Path) -> Dataset:
        dataset = Dataset(small)
        rebuild(catalog, dataset)
        return dataset

    def ids(self, catalog: Catalog, dataset: Dataset, **wanted: str) -> list[str]:
        location = location_of(dataset.path, catalog.address)
        page = list_episodes(catalog, location, PageFilter(**wanted))
        return [row["episode_id"] for row in page.episodes]

    @pytest.mark.parametrize(
        ("wanted", "found"),
        [
            ({}, [CLEAR, WET, NIGHT]),
            ({"town": "Stage01"}, [CLEAR, NIGHT]),
            ({"weather": "HardRainNoon"}, [WET]),
            ({"sensor": "lidar"}, [WET]),
            ({"label": "car"}, [CLEAR, WET]),
            ({"label": "car", "town": "Stage01"}, [CLEAR]),
            ({"label": "bus"}, []),
        ],
        ids=str,
    )
    def test_episodes_are_found_by_what_they_are(
        self, catalog: Catalog, indexed: Dataset, wanted: dict[str, str], found: list[str]
    ) -> None:
        assert self.ids(catalog, indexed, **wanted) == found

    def test_pages_follow_each_other_without_gap_or_overlap(
        self, catalog: Catalog, indexed: Dataset
    ) -> None:
        location = location_of(indexed.path, catalog.address)
        first = list_episodes(catalog, location, limit=2)
        assert first.after is not None
        second = list_episodes(catalog, location, limit=2, after=first.after)
        found = [row["episode_id"] for row in (*first.episodes, *second.episodes)]
        assert (found, second.after) == ([CLEAR, WET, NIGHT], None)

    def test_an_episode_shows_sensors_files_and_labels(
        self, catalog: Catalog, indexed: Dataset
    ) -> None:
        location = location_of(indexed.path, catalog.address)
        found = show_episode(catalog, location, WET)
        assert [row["kind"] for row in found["sensors"]] == ["lidar", "rgb"]
        assert found["attempts"] == {"a1": "committed"}
        marker = indexed.episode(WET).marker
        assert found["files"] == len(marker.files)
        assert sum(row["bytes"] for row in found["artifacts"]) == found["bytes"]
        walkers = {row["class"]: row for row in found["labels"]}["walker_adult"]
        assert walkers == {
            "class": "walker_adult", "tracks": 5, "rows": 20, "frames_1": 4, "frames_3": 4,
            "frames_5": 4, "frames_10": 0, "most_in_frame": 5, "nearest_m": 5.0,
        }  # fmt: skip

    def test_the_ego_is_no_object_of_its_episode(self, catalog: Catalog, indexed: Dataset) -> None:
        assert NIGHT not in self.ids(catalog, indexed, label="car")

    def test_rebuilding_twice_changes_nothing(self, catalog: Catalog, indexed: Dataset) -> None:
        before = query_catalog(catalog, "SELECT * FROM episodes ORDER BY id").to_pylist()
        summary = rebuild(catalog, indexed)
        assert (summary.episodes, summary.written, summary.removed) == (3, 3, 0)
        assert query_catalog(catalog, "SELECT * FROM episodes ORDER BY id").to_pylist() == before

    def test_updating_reads_only_what_is_new_or_gone(
        self, catalog: Catalog, indexed: Dataset
    ) -> None:
        add_episode(indexed.path, "00000000000000c4")
        (indexed.path / "commits" / f"{CLEAR}.json").unlink()
        dataset = Dataset(indexed.path)
        summary = rebuild(catalog, dataset, update=True)
        assert (summary.episodes, summary.written, summary.removed) == (3, 1, 1)
        assert self.ids(catalog, dataset) == [WET, NIGHT, "00000000000000c4"]
        for table in ("sensors", "artifacts", "label_summaries"):
            orphans = (
                f"SELECT count(*) AS n FROM {table} WHERE episode NOT IN (SELECT id FROM episodes)"
            )
            assert query_catalog(catalog, orphans).to_pylist() == [{"n": 0}]

    def test_splits_are_those_of_the_dataset(self, catalog: Catalog, indexed: Dataset) -> None:
        split_dataset(indexed.path, SplitRule(val=0.4))
        dataset = Dataset(indexed.path)
        rebuild(catalog, dataset, update=True)
        for name in ("train", "val"):
            drawn = {episode.id for episode in dataset.split(name)}
            assert set(self.ids(catalog, dataset, split=name)) == drawn
        rows = query_catalog(catalog, "SELECT name, share, episodes FROM splits ORDER BY name")
        assert rows.to_pylist() == [
            {"name": "train", "share": 0.6, "episodes": 2},
            {"name": "val", "share": 0.4, "episodes": 1},
        ]

    def test_many_may_record_the_same_episodes_at_once(
        self, address: CatalogAddress, small: Path
    ) -> None:
        def record(number: int) -> None:
            dataset = Dataset(small)
            with Catalog(address) as own:
                for episode in dataset.episodes:
                    record_episode(own, dataset, episode, f"run-{number}")

        with ThreadPoolExecutor(4) as threads:
            list(threads.map(record, range(4)))
        with Catalog(address) as catalog:
            assert sorted(self.ids(catalog, Dataset(small))) == [CLEAR, WET, NIGHT]
            count = "SELECT count(*) AS n FROM label_summaries"
            assert query_catalog(catalog, count).to_pylist() == [{"n": 4}]

    def test_a_damaged_episode_is_named_and_the_others_are_there(
        self, catalog: Catalog, small: Path
    ) -> None:
        (small / "episodes" / WET / "a1" / "objects.parquet").write_bytes(b"no table")
        summary = rebuild(catalog, Dataset(small))
        assert "objects.parquet" in summary.problems.pop(WET)
        assert not summary.problems
        assert self.ids(catalog, Dataset(small)) == [CLEAR, NIGHT]

    @pytest.mark.parametrize(
        ("path", "change", "named"),
        [
            ("commits/{}.json", {"frames": 10**30}, "frames"),
            ("commits/{}.json", {"versions": {"client": "a\0b"}}, "client"),
            ("commits/{}.json", {"versions": {"client": "a\ud800b"}}, "client"),
            (
                "episodes/{}/a1/calibration.json",
                {"width": 10**30, "K": [[9.0, 0.0, 5.0], [0.0, 9.0, 5.0], [0.0, 0.0, 1.0]]},
                "width",
            ),
            ("episodes/{}/a1/calibration.json", {"kind": "a\0b"}, "kind"),
        ],
    )
    def test_a_value_that_no_column_holds_is_a_problem_of_its_episode(
        self, catalog: Catalog, small: Path, path: str, change: dict[str, Any], named: str
    ) -> None:
        file = small / path.format(WET)
        document = json.loads(file.read_text())
        next(iter(document.get("sensors", {}).values()), document).update(change)
        file.write_text(json.dumps(document))
        summary = rebuild(catalog, Dataset(small))
        assert f"Its {named} cannot be" in summary.problems[WET]
        assert self.ids(catalog, Dataset(small)) == [CLEAR, NIGHT]

    def test_what_a_runs_folder_says_amiss_is_not_known(
        self, catalog: Catalog, small: Path
    ) -> None:
        folder = small / "runs" / "run-1"
        folder.mkdir(parents=True)
        status = {"state": ["done"], "episodes": {"total": 10**30, "committed": 3}}
        (folder / "status.json").write_text(json.dumps(status))
        (folder / "plan.json").write_text(json.dumps({"config": {"name": {}}, "shard": 5}))
        rebuild(catalog, Dataset(small))
        found = query_catalog(catalog, "SELECT run_id, name, state, total, committed FROM runs")
        assert found.to_pylist() == [
            {"run_id": "run-1", "name": None, "state": None, "total": None, "committed": 3}
        ]

    def test_an_episode_that_cannot_be_read_keeps_its_split(
        self, catalog: Catalog, indexed: Dataset
    ) -> None:
        split_dataset(indexed.path, SplitRule(val=0.4))
        add_episode(indexed.path, LATE)  # its split follows from its document
        rebuild(catalog, Dataset(indexed.path))
        (split,) = [
            name for name in ("train", "val") if LATE in self.ids(catalog, indexed, split=name)
        ]
        (indexed.path / "episodes" / LATE / "a1" / "episode.json").write_text("{}")
        summary = rebuild(catalog, Dataset(indexed.path))
        assert list(summary.problems) == [LATE]
        assert LATE in self.ids(catalog, indexed, split=split)

    def test_what_a_run_records_meanwhile_stays(self, catalog: Catalog, indexed: Dataset) -> None:
        split_dataset(indexed.path, SplitRule(val=0.4))

        def commit(done: int, total: int) -> None:
            if done == total:
                add_episode(indexed.path, LATE)
                now = Dataset(indexed.path)
                record_episode(catalog, now, now.episode(LATE), "run-1")

        rebuild(catalog, Dataset(indexed.path), progress=commit)
        found = show_episode(catalog, location_of(indexed.path, catalog.address), LATE)
        assert found["split"] == Dataset(indexed.path).splits()[LATE]
        assert found["attempts"] == {"a1": "committed"}

    def test_several_datasets_share_a_catalog(self, catalog: Catalog, tmp_path: Path) -> None:
        for name in ("one", "two"):
            add_episode(tmp_path / name, CLEAR, town=name)
            rebuild(catalog, Dataset(tmp_path / name))
        rebuild(catalog, Dataset(tmp_path / "one"))
        assert [row["map"] for row in list_episodes(catalog).episodes] == ["one", "two"]
        assert self.ids(catalog, Dataset(tmp_path / "two")) == [CLEAR]

    def test_a_dataset_that_is_not_there_is_named(self, catalog: Catalog, small: Path) -> None:
        with pytest.raises(BadInputError, match="does not know"):
            list_episodes(catalog, str(small))

    def test_what_differs_is_found(self, catalog: Catalog, indexed: Dataset) -> None:
        assert list(verify(catalog, indexed, deep=True)) == []
        folder = indexed.path / "episodes"
        (folder / CLEAR / "a1" / "ego.parquet").unlink()
        with (folder / WET / "a1" / "ego.parquet").open("ab") as file:
            file.write(b"more")
        same_size = folder / NIGHT / "a1" / "ego.parquet"
        content = bytearray(same_size.read_bytes())
        content[10] ^= 1
        same_size.write_bytes(content)
        add_episode(indexed.path, "00000000000000c4")
        marker = indexed.path / "commits" / f"{NIGHT}.json"
        marker.write_text(json.dumps({**json.loads(marker.read_text()), "frames": 3}))
        found = [(one.kind, one.episode_id) for one in verify(catalog, Dataset(indexed.path))]
        assert found == [
            ("missing", CLEAR),
            ("size", WET),
            ("other_marker", NIGHT),
            ("not_in_catalog", "00000000000000c4"),
        ]
        deep = [one.kind for one in verify(catalog, Dataset(indexed.path), deep=True)]
        assert deep == ["missing", "size", "other_marker", "hash", "not_in_catalog"]

    def test_its_tables_can_be_asked_and_not_changed(
        self, catalog: Catalog, indexed: Dataset
    ) -> None:
        found = query_catalog(catalog, "SELECT map, sum(frames) AS n FROM episodes "
                              "WHERE map LIKE '%01' GROUP BY map")  # fmt: skip
        assert [(row["map"], int(row["n"])) for row in found.to_pylist()] == [("Stage01", 8)]
        for words in ("DELETE FROM episodes", "SELECT nothing", "", "WITH x AS (SELECT 1) DELETE "
                      "FROM episodes"):  # fmt: skip
            with pytest.raises(BadInputError):
                query_catalog(catalog, words)
        assert len(self.ids(catalog, indexed)) == 3


class TestSqlite(CatalogTests):
    @pytest.fixture
    def address(self, tmp_path: Path) -> CatalogAddress:
        return parse_address(str(tmp_path / "here" / "catalog.sqlite"), secret=False)

    def test_labels_are_not_copied_into_it(self, catalog: Catalog, indexed: Dataset) -> None:
        with pytest.raises(BadInputError, match="not loaded into SQLite"):
            load_labels(catalog, indexed)

    def test_a_column_of_numbers_and_texts_becomes_texts(
        self, catalog: Catalog, indexed: Dataset
    ) -> None:
        words = "SELECT 'all' AS map, count(*) AS n FROM episodes UNION ALL SELECT 'none', '-'"
        assert query_catalog(catalog, words).to_pylist() == [
            {"map": "all", "n": "3"},
            {"map": "none", "n": "-"},
        ]

    def test_it_is_written_ahead(self, catalog: Catalog) -> None:
        with catalog.reading() as connection:
            assert connection.exec_driver_sql("PRAGMA journal_mode").scalar() == "wal"

    def test_what_is_no_database_is_refused(self, tmp_path: Path) -> None:
        file = tmp_path / "text.sqlite"
        file.write_text("this is a long text and certainly no database")
        with pytest.raises(CatalogError, match="not a database") as caught:
            Catalog(parse_address(str(file), secret=False))
        assert caught.value.exit_code == 2

    def test_a_catalog_in_the_datasets_folder_may_be_moved_with_it(
        self, small: Path, tmp_path: Path
    ) -> None:
        address = parse_address(str(small / "catalog.sqlite"), secret=False)
        with Catalog(address) as catalog:
            rebuild(catalog, Dataset(small))
        moved = small.rename(tmp_path / "elsewhere")
        again = parse_address(str(moved / "catalog.sqlite"), secret=False)
        with Catalog(again, create=False) as catalog:
            assert self.ids(catalog, Dataset(moved)) == [CLEAR, WET, NIGHT]


class PostgresTests(CatalogTests):
    """What only PostgreSQL has; subclasses give the fixture ``server``."""

    @pytest.fixture
    def address(self, server: PostgresServer) -> CatalogAddress:
        server.create("catalog")
        return parse_address(server.good_address, secret=True)

    def test_label_tables_are_copied_once_however_often(
        self, catalog: Catalog, small: Path
    ) -> None:
        for folder in (small / "episodes").iterdir():
            # Every episode has the table; that it is empty of nested columns is no matter here.
            objects = (folder / "a1" / "objects.parquet").read_bytes()
            (folder / "a1" / "camera_objects.parquet").write_bytes(objects)
        dataset = Dataset(small)
        first, second = load_labels(catalog, dataset), load_labels(catalog, dataset)
        count = "SELECT episode_id, count(*) AS n FROM loaded_objects GROUP BY 1 ORDER BY 1"
        rows = [(row["episode_id"], row["n"]) for row in query_catalog(catalog, count).to_pylist()]
        assert rows == [(CLEAR, 16), (WET, 28), (NIGHT, 8)]
        assert first == second == 2 * sum(n for _, n in rows) + 12

    def test_copied_labels_are_those_of_the_files_of_now(
        self, catalog: Catalog, analytic: Path, tmp_path: Path
    ) -> None:
        shutil.copytree(analytic, tmp_path / "set")
        (episode,) = Dataset(tmp_path / "set").episodes
        assert load_labels(catalog, Dataset(tmp_path / "set")) > 0
        count = "SELECT count(*) AS n FROM loaded_objects"
        write_table(episode.objects().slice(0, 0), Path(str(episode.folder)) / "objects.parquet")
        load_labels(catalog, Dataset(tmp_path / "set"))
        assert query_catalog(catalog, count).to_pylist() == [{"n": 0}]
        (tmp_path / "set" / "commits" / f"{episode.id}.json").unlink()
        load_labels(catalog, Dataset(tmp_path / "set"))
        count = "SELECT count(*) AS n FROM loaded_ego"
        assert query_catalog(catalog, count).to_pylist() == [{"n": 0}]

    def test_every_column_of_the_label_tables_has_a_type_there(
        self, catalog: Catalog, analytic: Path
    ) -> None:
        dataset = Dataset(analytic)
        assert load_labels(catalog, dataset) > 0
        objects = dataset.episodes[0].objects()
        rows = query_catalog(catalog, "SELECT * FROM loaded_objects ORDER BY k, track_id")
        assert set(objects.column_names) <= set(rows.column_names)
        mine = sorted(objects.to_pylist(), key=lambda row: (row["k"], row["track_id"]))
        for found, row in zip(rows.to_pylist(), mine, strict=True):
            assert found["box_center"] == row["box_center"]
            assert found["semantic_tags"] == row["semantic_tags"]
            assert json.loads(found["num_lidar_points"]) == dict(row["num_lidar_points"])

    @pytest.mark.parametrize("how", ["password", "none", "database"])
    def test_who_may_not_is_told_so_without_the_password(
        self, server: PostgresServer, how: str
    ) -> None:
        given = {
            "password": server.address(password="a-wrong-secret"),
            "none": server.address(),
            "database": server.address(database="nowhere", password="p%26ss%2Fw%25rd"),
        }[how]
        with pytest.raises(CatalogError, match="cannot be opened") as caught:
            Catalog(parse_address(given, secret=True))
        assert caught.value.exit_code == 2
        for secret in ("a-wrong-secret", "p%26ss", "p&ss"):
            assert secret not in str(caught.value)


class TestWheelPostgres(PostgresTests):
    @pytest.fixture
    def server(self, wheel_postgres: PostgresServer) -> PostgresServer:
        return wheel_postgres


class TestDebianPostgres(PostgresTests):
    @pytest.fixture
    def server(self, debian_postgres: PostgresServer) -> PostgresServer:
        return debian_postgres
