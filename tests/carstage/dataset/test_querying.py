"""SQL over a dataset gives what its tables hold."""

from __future__ import annotations

from pathlib import Path

import pytest

from analytic_dataset import attempt_of, make_dataset
from carstage.dataset import Dataset
from carstage.errors import BadInputError, DatasetError

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


@pytest.mark.parametrize("query", ["SELECT nothing FROM objects", "SELEC"])
def test_queries_that_cannot_be_are_refused_in_words(dataset: Path, query: str) -> None:
    with pytest.raises(BadInputError):
        Dataset(dataset).sql(query)


def test_a_damaged_table_is_named(tmp_path: Path) -> None:
    folder = make_dataset(tmp_path / "out", tmp_path / "raw", steps=1)
    (attempt_of(folder) / "ego.parquet").write_bytes(b"no table")
    with pytest.raises(DatasetError, match=r"ego\.parquet"):
        Dataset(folder).sql("SELECT count(*) FROM ego")
