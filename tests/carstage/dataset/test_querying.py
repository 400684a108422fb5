"""SQL over a dataset gives what its tables hold."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import obstore
import obstore.store
import pytest

from analytic_dataset import attempt_of, make_dataset
from carstage.dataset import Dataset
from carstage.dataset.querying import AGENT_TABLES, TABLES, EpisodeTables, query_episodes
from carstage.dataset.tables import read_table, write_table
from carstage.errors import BadInputError, DatasetError
from small_episodes import add_episode

pytest.importorskip("duckdb", reason="the extra sql is not installed")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    work = tmp_path_factory.mktemp("it's raw")
    return make_dataset(tmp_path_factory.mktemp("it's a dataset") / "out", work, steps=2)


def test_a_query_sees_the_rows_of_the_tables(dataset: Path) -> None:
    found = Dataset(dataset).sql(
        "SELECT class, count(*) AS rows FROM objects WHERE NOT is_ego GROUP BY class ORDER BY class"
    )
    assert found.to_pylist() == [
        {"class": "car", "rows": 4},  # one drives, one is parked
        {"class": "traffic_light", "rows": 2},
        {"class": "truck", "rows": 2},
        {"class": "walker_adult", "rows": 2},
    ]


def test_every_table_can_be_joined_by_episode_frame_and_track(dataset: Path) -> None:
    episode = Dataset(dataset).episodes[0]
    found = Dataset(dataset).sql(
        """
        SELECT count(*) AS rows, any_value(episode_id) AS episode
        FROM camera_objects
        JOIN objects USING (episode_id, k, track_id)
        JOIN ego USING (episode_id, k)
        JOIN frames USING (episode_id, k)
        JOIN sensor_poses USING (episode_id, k, sensor_id)
        """
    )
    rows = episode.camera_objects().num_rows
    assert rows > 0
    assert found.to_pylist() == [{"rows": rows, "episode": episode.id}]


def test_folders_with_equals_signs_are_no_columns(tmp_path: Path) -> None:
    folder = tmp_path / "class=bus" / "track_id=7" / "seed=1"
    add_episode(folder, f"{1:016x}", objects={"car": 2})
    rows = Dataset(folder).sql("SELECT * FROM objects WHERE NOT is_ego AND k = 0")
    assert rows["class"].to_pylist() == ["car", "car"]
    assert len(set(rows["track_id"].to_pylist())) == 2
    assert "seed" not in rows.column_names


@pytest.mark.parametrize("query", ["SELECT nothing FROM objects", "SELEC"])
def test_queries_that_cannot_be_are_refused_in_words(dataset: Path, query: str) -> None:
    with pytest.raises(BadInputError):
        Dataset(dataset).sql(query)


def test_a_damaged_table_is_named(tmp_path: Path) -> None:
    folder = make_dataset(tmp_path / "out", tmp_path / "raw", steps=1)
    (attempt_of(folder) / "ego.parquet").write_bytes(b"no table")
    with pytest.raises(DatasetError, match=r"ego\.parquet"):
        Dataset(folder).sql("SELECT count(*) FROM ego")


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve episodes; the tables of objects of the last one have some ten row groups."""
    folder = tmp_path_factory.mktemp("many") / "out"
    for number in range(11):
        add_episode(folder, f"{number:016x}", objects={"car": 40})
    add_episode(folder, f"{11:016x}", objects={"car": 9000}, rows_of_group=3700)
    return folder


class MemoryFiles:
    """A dataset in an object store, read in ranges by ``obstore``."""

    def __init__(self, folder: Path) -> None:
        self.store = obstore.store.MemoryStore()
        self.opened: set[str] = set()
        self.ranges: list[tuple[int, int]] = []
        for path in folder.rglob("*.parquet"):
            obstore.put(self.store, str(path), path)

    def size(self, path: str) -> int:
        return int(obstore.head(self.store, path)["size"])

    def read(self, path: str, start: int, end: int) -> bytes:
        self.opened.add(path)
        self.ranges.append((start, end))
        return bytes(obstore.get_range(self.store, path, start=start, end=end))


@pytest.fixture(params=["here", "elsewhere"])
def files(request: pytest.FixtureRequest, many: Path) -> MemoryFiles | None:
    return MemoryFiles(many) if request.param == "elsewhere" else None


def tables_of(folder: Path) -> list[EpisodeTables]:
    return [episode.tables for episode in Dataset(folder).episodes]


def read_bytes(many: Path, query: str, files: MemoryFiles | None) -> tuple[object, int]:
    answer = query_episodes(tables_of(many), query, files=files)
    assert answer.bytes_read is not None
    (value,) = answer.table.to_pylist()[0].values()
    return value, answer.bytes_read


def test_only_files_of_the_episodes_that_are_asked_for_are_opened(
    many: Path, files: MemoryFiles | None
) -> None:
    everything = read_bytes(many, "SELECT count(k) FROM objects", files)
    assert everything[0] == 11 * 4 * 41 + 4 * 9001
    if files is not None:
        assert len(files.opened) == 12
        files.opened.clear()
    one = "SELECT count(k) FROM objects WHERE episode_id = '0000000000000003'"
    found, some = read_bytes(many, one, files)
    assert found == 4 * 41
    assert some < everything[1] / 2
    if files is not None:  # the first file tells the columns
        assert {Path(path).parts[-3] for path in files.opened} <= {f"{0:016x}", f"{3:016x}"}


def test_only_row_groups_that_may_fit_are_read(many: Path, files: MemoryFiles | None) -> None:
    of_one = "SELECT sum(distance_ego) FROM objects WHERE episode_id = '000000000000000b'"
    _, whole = read_bytes(many, of_one, files)
    _, some = read_bytes(many, f"{of_one} AND k = 2", files)
    assert some < 0.8 * whole


def test_only_tables_that_are_named_are_read(many: Path, files: MemoryFiles | None) -> None:
    answer = query_episodes(tables_of(many), "SELECT count(*) FROM ego", files=files)
    assert answer.files == 12
    if files is not None:
        assert {Path(path).name for path in files.opened} == {"ego.parquet"}


def test_a_file_that_is_missing_elsewhere_is_named(many: Path) -> None:
    files = MemoryFiles(many)
    obstore.delete(files.store, str(many / "episodes" / f"{5:016x}" / "a1" / "ego.parquet"))
    with pytest.raises(DatasetError, match=f"{5:016x}"):
        query_episodes(tables_of(many), "SELECT sum(speed) FROM ego", files=files)


def test_episodes_of_several_versions_are_joined_by_the_names_of_columns(tmp_path: Path) -> None:
    for number in range(2):
        add_episode(tmp_path / "out", f"{number:016x}")
    marker = tmp_path / "out" / "commits" / f"{0:016x}.json"
    document = json.loads(marker.read_text())
    document["versions"]["carstage"] = "0.0.9"
    marker.write_text(json.dumps(document))
    older = tmp_path / "out" / "episodes" / f"{0:016x}" / "a1" / "objects.parquet"
    write_table(read_table(older).drop_columns(["distance_ego"]), older)
    found = Dataset(tmp_path / "out").sql("SELECT count(distance_ego) AS n FROM objects")
    assert found.to_pylist() == [{"n": 8}]


def with_agents(dataset: Path, tmp_path: Path, *names: str) -> EpisodeTables:
    """The tables of an episode, and copies of them as those of agents."""
    tables = Dataset(dataset).episodes[0].tables
    folder = tmp_path / "episodes" / "e1" / "a1"
    for below in (folder, *(folder / "agents" / name for name in names)):
        below.mkdir(parents=True)
        for file in TABLES.values():
            (below / file).write_bytes((tables.folder / file).read_bytes())
    return EpisodeTables(folder, tables.version, names)


def test_tables_of_agents_say_whose_each_row_is(dataset: Path, tmp_path: Path) -> None:
    episode = with_agents(dataset, tmp_path, "car2", "mast")
    own = query_episodes([episode], "SELECT count(*) AS n FROM objects").table.to_pylist()
    for name in AGENT_TABLES:
        query = f"SELECT agent, episode_id, count(*) AS n FROM {name} GROUP BY ALL ORDER BY agent"
        found = query_episodes([episode], query)
        assert [row["agent"] for row in found.table.to_pylist()] == ["car2", "mast"]
        assert {row["episode_id"] for row in found.table.to_pylist()} == {"e1"}
        assert found.files == 2
        if name == "agent_objects":
            assert [row["n"] for row in found.table.to_pylist()] == [own[0]["n"]] * 2


def test_tables_seen_as_an_agent_have_the_episode_s_id(dataset: Path, tmp_path: Path) -> None:
    episode = with_agents(dataset, tmp_path, "car2")
    seen = EpisodeTables(episode.folder / "agents" / "car2", episode.version)
    found = query_episodes([seen], "SELECT DISTINCT episode_id FROM frames").table
    assert found.to_pylist() == [{"episode_id": "e1"}]


def test_only_folders_with_an_agent_s_name_are_agents(dataset: Path) -> None:
    episode = Dataset(dataset).episodes[0]
    one = episode.marker.files[0]
    paths = ("agents/car2/ego.parquet", "agents/../ego.parquet", "agents/note.txt", "agents")
    files = tuple(replace(one, path=path) for path in paths)
    episode.marker = replace(episode.marker, files=(*episode.marker.files, *files))
    assert episode.tables.agents == ("car2",)


def test_tables_of_agents_that_there_are_not_are_refused(dataset: Path) -> None:
    with pytest.raises(BadInputError, match="no table agent_ego"):
        Dataset(dataset).sql("SELECT * FROM agent_ego")
