"""Parquet files name no version of a library: their bytes follow from their rows."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from carstage.dataset import tables
from carstage.dataset.tables import read_table, table_of, write_table
from carstage.errors import StorageError

TABLE = pa.table({"k": pa.array(range(100_000), pa.int32()), "text": ["a", "b"] * 50_000})


def test_a_file_names_us_and_no_version_of_arrow(tmp_path: Path) -> None:
    path = tmp_path / "table.parquet"
    write_table(TABLE, path)
    assert pa.__version__.encode() not in path.read_bytes()
    metadata = pq.ParquetFile(path).metadata
    assert metadata.created_by == "carstage version 1"
    assert (metadata.num_row_groups, metadata.num_rows) == (2, 100_000)
    assert metadata.row_group(1).column(0).statistics.max == 99_999


def test_readers_read_it(tmp_path: Path) -> None:
    path = tmp_path / "table.parquet"
    write_table(TABLE, path)
    assert read_table(path).equals(TABLE)
    found = duckdb.sql(f"select count(*), max(k), min(text) from '{path}' where k >= 70000")
    assert found.fetchall() == [(30_000, 99_999, "a")]


def test_a_footer_that_is_not_understood_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "_ARROWS_NAME", re.compile(b"another writer"))
    with pytest.raises(StorageError, match="not understood"):
        write_table(TABLE, tmp_path / "table.parquet")
    assert not list(tmp_path.iterdir())


def test_a_frame_of_messages_has_an_entry_for_each_and_may_have_none() -> None:
    radio = tables.row_sensor("v2x")
    assert radio is not None
    width = len(radio.columns)
    sent = np.arange(2.0 * width).reshape(2, width)
    sent[1, 5:] = np.nan
    row = radio.row(3, 0.3, memoryview(sent.tobytes()))
    assert row["station_id"] == [0.0, width]
    np.testing.assert_array_equal(radio.array(row), sent)
    nothing = radio.row(4, 0.4, memoryview(b""))
    assert radio.array(nothing).shape == (0, width)
    made = pa.Table.from_pylist([row, nothing], schema=radio.schema)
    assert made["power_dbm"].to_pylist()[1] == []
    with pytest.raises(ValueError, match="no whole number of messages"):
        radio.row(0, 0.0, memoryview(bytes(8)))


@pytest.mark.parametrize("read", [read_table, lambda path: table_of(path.read_bytes())])
def test_arrow_reads_from_memory_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: Callable[[Path], pa.Table]
) -> None:
    """Its threads may drop a Python object when the interpreter has ended, and abort it."""
    path = tmp_path / "table.parquet"
    write_table(TABLE, path)
    open_file, before = pq.ParquetFile, pa.total_allocated_bytes()

    def opened(source: object) -> pq.ParquetFile:
        assert isinstance(source, pa.BufferReader)
        assert pa.total_allocated_bytes() - before >= path.stat().st_size
        return open_file(source)

    monkeypatch.setattr(tables.pq, "ParquetFile", opened)
    assert read(path).equals(TABLE)
