"""Lines of a recording: what they show, and that every edit of them is found."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import analytic_scene
import small_maps
from analytic_dataset import attempt_of, edit_rows, recommit
from carstage.dataset import Dataset
from carstage.dataset.tables import read_table
from carstage.rawlog.writing import write_episode_file, write_map_file
from carstage.report.lane_lines import lane_lines_section
from carstage.runs.attempt_commit import AttemptCommit
from carstage.runs.jobs import Job
from carstage.storage import LocalStore
from carstage.validation import validate_dataset

FILE = "lane_lines.parquet"
Row = dict[str, Any]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The depth camera of CAM_FRONT is in the dataset, that of CAM_LEFT a hidden twin."""
    folder = tmp_path_factory.mktemp("lines")
    raw = folder / "raw"
    header = analytic_scene.write_raw_log(raw, steps=2, size=(192, 128))
    header["map_crc32"] = write_map_file(str(raw), small_maps.parking_street())
    header["spec"]["labels"]["lane_lines"] = True
    write_episode_file(str(raw), header)
    store = LocalStore(folder / "out")
    store.initialise("lines")
    job: Any = Job(
        SimpleNamespace(saved_frames=2, agents=(), written_sensors=()), header["episode_id"]
    )
    with ThreadPoolExecutor(1) as pool:
        attempt = AttemptCommit(job, "a1", raw, store, pool, {}, deferred=True)
        attempt.convert_all(pool)
        attempt.commit()
    return folder / "out"


@pytest.fixture
def dataset(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "out"))


def found(dataset: Path) -> list[str]:
    checks = ("lane_lines", "file_missing", "file_unlisted", "file_unexpected", "unreadable")
    problems = validate_dataset(dataset).problems
    return [f"{one.check}: {one.message}" for one in problems if one.check in checks]


def test_an_undamaged_dataset_has_the_lines_that_follow(whole: Path) -> None:
    assert found(whole) == []


def test_places_lie_on_the_map_s_lines(whole: Path) -> None:
    (episode,) = Dataset(whole).episodes
    table, town = episode.lane_lines(), episode.vector_map()
    assert table is not None
    assert town is not None
    poses = episode.world_from_sensor()
    compared = 0
    for row in table.to_pylist():
        if row["kind"] != "marking":
            continue
        x, y, z = (np.array(row[name]) for name in "xyz")
        pose = poses[row["sensor_id"]][row["k"]]
        world = np.column_stack([z, x, -y]) @ pose[:3, :3].T + pose[:3, 3]
        # The street runs along x: a marking has one y.
        (line_y,) = set(town.marking_by_id[row["map_id"]].line[:, 1].tolist())
        np.testing.assert_allclose(world[:, 1], line_y, atol=2e-3)
        np.testing.assert_allclose(world[:, 2], 0.0, atol=2e-3)
        compared += len(world)
    assert compared > 100


def test_a_place_that_something_hides_is_hidden(whole: Path) -> None:
    (episode,) = Dataset(whole).episodes
    table = episode.lane_lines()
    assert table is not None
    seen = np.concatenate([row["visible"] for row in table.to_pylist()])
    assert set(seen.tolist()) == {0, 1}
    hidden_places = seen_places = 0
    depth_m = next(iter(episode.iter_frames())).read("DEPTH_FRONT")
    for row in table.to_pylist():
        if row["k"] or row["sensor_id"] != "CAM_FRONT":
            continue
        for u, v, z, visible in zip(row["u"], row["v"], row["z"], row["visible"], strict=True):
            row_px, column_px = min(int(v), 127), min(int(u), 191)
            around = depth_m[max(row_px - 1, 0) : row_px + 2, max(column_px - 1, 0) : column_px + 2]
            if z > around.max() * 1.3 + 1.0:  # far behind what is there
                assert not visible
                hidden_places += 1
            elif z < depth_m[row_px, column_px] * 1.01:
                assert visible
                seen_places += 1
    assert hidden_places > 10
    assert seen_places > 10


def of_camera(rows: list[Row], camera: str) -> Row:
    return next(row for row in rows if row["sensor_id"] == camera and row["kind"] == "marking")


def shifted(row: Row) -> None:
    row["u"] = [value + 0.5 for value in row["u"]]


def renamed(row: Row) -> None:
    row["map_id"] = "99/0/1/0"


def yellow(row: Row) -> None:
    row["colour"] = "yellow"


def hidden(row: Row) -> None:
    row["visible"] = [1 - value for value in row["visible"]]


def shortened(row: Row) -> None:
    row["visible"] = [1] * (len(row["visible"]) - 1)
    row["visible_share"] = 1.0


def doubled(row: Row) -> None:
    row["visible"] = [2 for _ in row["visible"]]


def less(row: Row) -> None:
    row["visible_share"] /= 2


@pytest.mark.parametrize(
    ("camera", "edit", "message"),
    [
        ("CAM_FRONT", shifted, "u of it is wrong"),
        ("CAM_LEFT", shifted, "u of it is wrong"),
        ("CAM_FRONT", renamed, "marking 99/0/1/0 is not seen there"),
        ("CAM_LEFT", renamed, "marking 99/0/1/0 is not seen there"),
        ("CAM_LEFT", yellow, "colour of it is wrong"),
        ("CAM_FRONT", hidden, "visible of it is wrong"),
        ("CAM_LEFT", shortened, "visible of it is wrong"),
        ("CAM_LEFT", doubled, "visible, visible_share of it is wrong"),
        ("CAM_LEFT", less, "visible_share of it is wrong"),
    ],
)
def test_an_edit_is_found(
    dataset: Path, camera: str, edit: Callable[[Row], None], message: str
) -> None:
    def edited(rows: list[Row]) -> list[Row]:
        edit(of_camera(rows, camera))
        return rows

    edit_rows(dataset, FILE, edited)
    assert any(f"{camera}: " in one and message in one for one in found(dataset)), found(dataset)


def test_what_only_a_dropped_depth_image_tells_is_taken_as_stored(dataset: Path) -> None:
    def edited(rows: list[Row]) -> list[Row]:
        row = of_camera(rows, "CAM_LEFT")
        hidden(row)
        row["visible_share"] = float(np.mean(row["visible"]))
        return rows

    edit_rows(dataset, FILE, edited)
    assert found(dataset) == []


def test_a_line_that_is_missing_is_found(dataset: Path) -> None:
    def edited(rows: list[Row]) -> list[Row]:
        rows.remove(of_camera(rows, "CAM_FRONT"))
        return rows

    edit_rows(dataset, FILE, edited)
    assert any("is missing" in one for one in found(dataset))


def test_a_line_that_is_there_twice_is_found(dataset: Path) -> None:
    def edited(rows: list[Row]) -> list[Row]:
        return [*rows, of_camera(rows, "CAM_FRONT")]

    edit_rows(dataset, FILE, edited)
    (message,) = found(dataset)
    assert message.endswith("is there twice")


def test_a_line_of_a_frame_that_there_is_not_is_found(dataset: Path) -> None:
    def edited(rows: list[Row]) -> list[Row]:
        return [*rows, of_camera(rows, "CAM_FRONT") | {"k": 99}]

    edit_rows(dataset, FILE, edited)
    assert not validate_dataset(dataset).ok


@pytest.mark.parametrize("column", ["map_id", "u", "visible", "visible_share"])
def test_a_null_is_found(dataset: Path, column: str) -> None:
    path = attempt_of(dataset) / FILE
    table = read_table(path)
    values = pa.array([None, *table[column].to_pylist()[1:]])
    pq.write_table(table.set_column(table.column_names.index(column), column, values), path)
    recommit(dataset)
    assert any(f"{FILE}: {column} is null in 1 rows." in one for one in found(dataset))


def test_a_missing_table_is_found(dataset: Path) -> None:
    (attempt_of(dataset) / FILE).unlink()
    assert any(FILE in one for one in found(dataset))


def test_the_report_shows_each_labelled_camera(whole: Path) -> None:
    (episode,) = Dataset(whole).episodes
    section = lane_lines_section(episode, [0])
    for camera in ("CAM_FRONT", "CAM_LEFT"):
        assert f"{camera}, frame 0" in section
    assert section.count("<img") == 2
