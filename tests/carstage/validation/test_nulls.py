"""A value that is missing is noticed, in every column that may not lack it in that row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from carstage.annotation.schema import (
    CAMERA_OBJECT_COLUMNS,
    EGO_COLUMNS,
    OBJECT_COLUMNS,
    Column,
)
from carstage.dataset import Dataset, Episode
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables
from carstage.validation.checks.nulls import check_nulls

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("recorded")]

KEYS = {"k", "track_id", "sensor_id", "class", "box_source", "is_static"}
"""By these rows are told apart; files cannot hold nulls there."""
UNDECIDABLE = {
    "is_dormant", "light_state", "parent_track_id", "speed_limit_kmh", "weather_preset",
}  # fmt: skip
TABLES: dict[str, tuple[Sequence[Column], set[str]]] = {
    "objects": (OBJECT_COLUMNS, set()),
    "camera_objects": (CAMERA_OBJECT_COLUMNS, set()),
    "ego": (EGO_COLUMNS, {"traffic_light_state"}),  # whether a light affects the ego
}


def problems(episode: Episode, tables: LabelTables) -> list[str]:
    findings = Findings(episode.id)
    check_nulls(episode, tables, findings)
    return [problem.message for problem in findings.problems()]


def without_one(table: pa.Table, column: str) -> pa.Table:
    """The table without the last value of a column that there is."""
    values: list[Any] = table[column].to_pylist()
    last = max(i for i, value in enumerate(values) if value is not None)
    values[last] = None
    array = pa.array(values, table[column].type)
    return table.set_column(table.column_names.index(column), pa.field(column, array.type), array)


@pytest.mark.parametrize("name", TABLES)
def test_a_missing_value_is_noticed(recorded: Path, name: str) -> None:
    episode = Dataset(recorded).episodes[0]
    tables = LabelTables.load(episode)
    columns, undecidable = TABLES[name]
    table = tables.named()[name]
    assert problems(episode, tables) == []
    missed = [
        column.name
        for column in columns
        if column.name not in KEYS | UNDECIDABLE | undecidable
        and not any(
            f"{name}.parquet: {column.name} of" in message
            for message in problems(
                episode, replace(tables, **{name: without_one(table, column.name)})
            )
        )
    ]
    assert missed == []


def test_a_value_where_none_may_be_is_noticed(recorded: Path) -> None:
    episode = Dataset(recorded).episodes[0]
    tables = LabelTables.load(episode)
    states: list[Any] = tables.objects["traffic_light_state"].to_pylist()
    states[states.index(None)] = "Green"
    at = tables.objects.column_names.index("traffic_light_state")
    objects = tables.objects.set_column(at, "traffic_light_state", pa.array(states))

    (message,) = problems(episode, replace(tables, objects=objects))

    assert "traffic_light_state" in message
    assert "should be null" in message
