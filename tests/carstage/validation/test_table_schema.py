"""Tables that do not hold what their format says are reported, whatever they hold instead."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from analytic_dataset import attempt_of, edit_rows, make_dataset, recommit
from carstage.dataset.tables import read_table
from carstage.validation import validate_dataset

NAN = float("nan")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tables")
    return make_dataset(folder / "out", folder / "raw", steps=2, size=(96, 64))


@pytest.fixture
def dataset(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "out"))


def found(dataset: Path, *checks: str) -> list[str]:
    problems = validate_dataset(dataset, workers=0).problems
    return [one.message for one in problems if not checks or one.check in checks]


def rewrite(dataset: Path, file: str, table: pa.Table) -> None:
    """As other programs do: nothing is said of nulls, lists have no fixed size."""
    pq.write_table(table, attempt_of(dataset) / file)
    recommit(dataset)


def edit(dataset: Path, file: str, column: str, change: Callable[[list[Any]], list[Any]]) -> None:
    table = read_table(attempt_of(dataset) / file)
    values = pa.array(change(table[column].to_pylist()))
    rewrite(dataset, file, table.set_column(table.column_names.index(column), column, values))


def of_last(change: Callable[[Any], Any]) -> Callable[[list[Any]], list[Any]]:
    """Change the last value that there is."""

    def changed(values: list[Any]) -> list[Any]:
        last = max(i for i, value in enumerate(values) if value is not None)
        return [change(value) if i == last else value for i, value in enumerate(values)]

    return changed


def as_text(values: list[Any]) -> list[Any]:
    return list(map(str, values))


cut, gap = of_last(lambda value: value[:-1]), of_last(lambda value: [None, *value[1:]])
gone, not_a_number = of_last(lambda value: None), of_last(lambda value: NAN)


@pytest.mark.parametrize(
    ("file", "column", "change", "said"),
    [
        ("objects.parquet", "k", as_text, "string, not i32"),
        ("objects.parquet", "velocity", as_text, "string, not f64[3]"),
        ("objects.parquet", "box_extent", cut, "lists that are no f64[3]"),
        ("objects.parquet", "actor_location", gap, "lists that are no f64[3]"),
        ("camera_objects.parquet", "bbox_amodal", cut, "lists that are no f64[4]"),
        ("camera_objects.parquet", "corners_uv", cut, "lists that are no f64[8][2]"),
        ("camera_objects.parquet", "n_visible", of_last(lambda v: v + 0.5), "double, not u8"),
        ("ego.parquet", "weather", of_last(lambda v: "sun"), "text that is no JSON object"),
        ("sensor_poses.parquet", "location", cut, "lists that are no f64[3]"),
        ("frames.parquet", "timestamp_s", as_text, "string, not f64"),
    ],
)
def test_a_column_of_something_else_is_named(
    dataset: Path, file: str, column: str, change: Callable[[list[Any]], list[Any]], said: str
) -> None:
    edit(dataset, file, column, change)
    assert f"{file}: column {column} holds {said}." in found(dataset, "unreadable")


@pytest.mark.parametrize(
    ("file", "column"),
    [
        ("camera_objects.parquet", "center_cam"),
        ("ego.parquet", "weather"),
        ("sensor_poses.parquet", "ego_from_sensor"),
    ],
)
def test_a_column_that_is_missing_is_named(dataset: Path, file: str, column: str) -> None:
    rewrite(dataset, file, read_table(attempt_of(dataset) / file).drop_columns([column]))
    assert f"{file} has no column {column}." in found(dataset, "unreadable")


@pytest.mark.parametrize(
    ("file", "column"),
    [
        ("objects.parquet", "timestamp_s"),
        ("camera_objects.parquet", "track_id"),
        ("ego.parquet", "location"),
        ("sensor_poses.parquet", "rotation_deg"),
    ],
)
def test_a_value_that_everything_needs_is_missed(dataset: Path, file: str, column: str) -> None:
    edit(dataset, file, column, gone)
    assert f"{file}: {column} is null in 1 rows." in found(dataset, "unreadable")
    assert any(f"{file}: {column} of" in message for message in found(dataset, "label_nulls"))


@pytest.mark.parametrize("column", ["box_center", "box_rotation_deg", "box_extent"])
def test_a_box_without_a_part_is_named(dataset: Path, column: str) -> None:
    edit(dataset, "objects.parquet", column, gone)
    (message,) = set(found(dataset, "unreadable"))
    assert "is not given where box_center is" in message
    assert any(f"objects.parquet: {column} of" in one for one in found(dataset, "label_nulls"))


def test_a_ledger_without_a_time_is_named(dataset: Path) -> None:
    edit(dataset, "frames.parquet", "timestamp_s", gone)
    assert "frames.parquet: timestamp_s is null in 1 rows." in found(dataset, "unreadable")


@pytest.mark.parametrize("column", ["n_occluded", "n_outside", "front_px", "hull_px", "visible_px"])
def test_checks_go_on_where_a_count_is_null(dataset: Path, column: str) -> None:
    edit(dataset, "camera_objects.parquet", column, gone)
    assert any(f"{column} of" in message for message in found(dataset, "label_nulls"))
    assert found(dataset, "unreadable") == []


@pytest.mark.parametrize(
    ("file", "column", "change"),
    [
        ("objects.parquet", "timestamp_s", not_a_number),
        ("objects.parquet", "box_extent", of_last(lambda value: [float("inf")] * 3)),
        ("camera_objects.parquet", "bbox_amodal", of_last(lambda value: [NAN] * 4)),
        ("camera_objects.parquet", "distance", not_a_number),
        ("ego.parquet", "angular_velocity", of_last(lambda value: [*value[:2], NAN])),
        ("sensor_poses.parquet", "timestamp_s", not_a_number),
        ("frames.parquet", "timestamp_s", not_a_number),
    ],
)
def test_what_is_no_number_is_found(
    dataset: Path, file: str, column: str, change: Callable[[list[Any]], list[Any]]
) -> None:
    edit(dataset, file, column, change)
    (message,) = set(found(dataset, "unreadable"))
    assert message.startswith(f"{file}: {column} holds ")
    assert message.endswith(" NaN or infinite values.")


def test_a_pose_of_a_frame_that_there_is_not_is_found(dataset: Path) -> None:
    def change(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return [*rows, rows[-1] | {"k": 99}]

    edit_rows(dataset, "sensor_poses.parquet", change)
    message = "sensor_poses.parquet has rows of frame 99, which the ledger has not"
    assert message in found(dataset, "label_timestamps")


def test_a_reading_without_a_time_is_found(dataset: Path) -> None:
    def change(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return [*rows[:-1], rows[-1] | {"timestamp_s": NAN}]

    edit_rows(dataset, "sensors/IMU.parquet", change)
    assert any("the row is at nan s" in message for message in found(dataset, "timestamps"))


def test_other_programs_lists_and_whole_floats_will_do(dataset: Path) -> None:
    edit(dataset, "objects.parquet", "velocity", list)
    edit(dataset, "objects.parquet", "traffic_light_state", lambda values: [None] * len(values))
    edit(dataset, "camera_objects.parquet", "visible_px", lambda values: list(map(float, values)))
    assert found(dataset, "unreadable") == []
