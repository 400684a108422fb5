"""The table of received V2X messages, of damaged files too."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pyarrow as pa
import pytest

from carstage.dataset.messages import message_table
from carstage.dataset.tables import row_sensor
from carstage.errors import DatasetError
from carstage.sensor_kinds.model import MESSAGES

KIND = row_sensor("v2x")
assert KIND is not None
NAMES = [name for name, _ in KIND.columns]


def radio(*, drop: str | None = None, kind: str = "v2x", **columns: list[float]) -> Any:
    """A V2X sensor whose only frame has one message of ones, but for some columns."""
    row = {"k": 4, "timestamp_s": 0.4, **{name: [1.0] for name in NAMES}, **columns}
    table = pa.Table.from_pylist([row], schema=KIND.schema)
    table = table if drop is None else table.drop_columns([drop])
    return SimpleNamespace(id="V2X", kind=kind, content=MESSAGES, table=table)


def test_a_message_is_a_row_with_null_for_what_it_does_not_say() -> None:
    table = message_table([radio(station_id=[7.0], speed_m_s=[float("nan")])])
    assert table is not None
    (row,) = table.to_pylist()
    assert (row["k"], row["sensor_id"], row["track_id"], row["station_id"]) == (4, "V2X", 7, 7)
    assert row["speed_m_s"] is None
    assert row["power_dbm"] == 1.0


def test_without_a_v2x_sensor_there_is_no_table() -> None:
    assert message_table([]) is None
    assert message_table([radio(kind="lora")]) is None, "a kind of another package"


@pytest.mark.parametrize(
    ("sensor", "text"),
    [
        (radio(drop="power_dbm"), "other columns"),
        (radio(power_dbm=[1.0, 2.0]), "differ in their length"),
        (radio(station_id=[1e300]), "V2X.parquet is damaged"),
        (radio(station_type=[1e12]), "V2X.parquet is damaged"),
    ],
)
def test_a_damaged_table_is_refused(sensor: Any, text: str) -> None:
    with pytest.raises(DatasetError, match=text):
        message_table([sensor])


def test_a_whole_number_that_is_infinite_is_not_said() -> None:
    table = message_table([radio(station_id=[float("inf")])])
    assert table is not None
    assert table["track_id"].to_pylist() == [None]
