"""Parquet files whose bytes follow from their rows, and the tables of the row-wise sensors."""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from carstage.errors import DatasetError, StorageError
from carstage.files.bounded import open_regular
from carstage.files.whole import whole_file
from carstage.sensor_kinds import known_kind
from carstage.sensor_kinds.model import DETECTIONS, MESSAGES, READING
from carstage.storage.remote_path import DatasetPath

_COMPRESSION: Literal["zstd"] = "zstd"
_COMPRESSION_LEVEL = 3
_ROW_GROUP_ROWS = 65_536
_TRAILER = struct.Struct("<I4s")
_ARROWS_NAME = re.compile(rb"parquet-cpp-arrow version [0-9A-Za-z.+-]+")
_WRITER = b"carstage version 1"


@dataclass(frozen=True, slots=True)
class RowSensor:
    """A sensor kind whose frames are rows of one table per episode.

    Attributes:
        columns: names of the values, with the number of float64 that each one takes.
    """

    columns: tuple[tuple[str, int], ...]

    @property
    def schema(self) -> pa.Schema:
        """``k``, ``timestamp_s`` and the columns; those of several values as fixed-size lists."""
        fields: list[pa.Field[Any]] = [
            pa.field("k", pa.int32(), nullable=False),
            pa.field("timestamp_s", pa.float64(), nullable=False),
        ]
        for name, count in self.columns:
            fields.append(pa.field(name, self._type(count), nullable=False))
        return pa.schema(fields)

    def row(self, k: int, timestamp_s: float, payload: memoryview) -> dict[str, Any]:
        """One row of the table from a record's payload.

        Raises:
            ValueError: it does not have the right number of finite numbers.
        """
        values = self._values(payload)
        if not np.isfinite(values).all():
            raise ValueError("a value is not finite")
        row: dict[str, Any] = {"k": k, "timestamp_s": timestamp_s}
        start = 0
        for name, count in self.columns:
            part = values[start : start + count]
            row[name] = part[0].tolist() if count == 1 else part.tolist()
            start += count
        return row

    def array(self, row: Mapping[str, Any]) -> NDArray[Any]:
        """The frame's numbers in the order of the columns."""
        return np.hstack([row[name] for name, _ in self.columns]).astype(np.float64)

    def _type(self, count: int) -> pa.DataType:
        return pa.float64() if count == 1 else vector(count)

    def _values(self, payload: memoryview) -> NDArray[Any]:
        values = np.frombuffer(payload, "<f8")
        width = sum(count for _, count in self.columns)
        if len(values) != width:
            raise ValueError(f"{width} numbers are needed, not {len(values)}")
        return values


@dataclass(frozen=True, slots=True)
class DetectionSensor(RowSensor):
    """A sensor whose frame is any number of detections: each column is a list, one entry for each.

    The columns stand in the order of the record's float32.
    """

    def array(self, row: Mapping[str, Any]) -> NDArray[Any]:
        """``(N, columns)`` float32."""
        return np.array([row[name] for name, _ in self.columns], np.float32).T

    def _type(self, count: int) -> pa.DataType:
        return pa.list_(pa.field("element", pa.float32(), nullable=False))

    def _values(self, payload: memoryview) -> NDArray[Any]:
        if len(payload) % (4 * len(self.columns)):
            raise ValueError(f"{len(payload)} bytes are no whole number of detections")
        return np.frombuffer(payload, "<f4").reshape(-1, len(self.columns)).T


@dataclass(frozen=True, slots=True)
class MessageSensor(RowSensor):
    """A sensor whose frame is any number of messages: each column is a list, an entry for each.

    The columns stand in the order of the record's float64. What a message does not say is NaN.
    """

    def row(self, k: int, timestamp_s: float, payload: memoryview) -> dict[str, Any]:
        """One row of the table from a record's payload.

        Raises:
            ValueError: it is no whole number of messages.
        """
        values = self._values(payload)
        columns = {name: values[i].tolist() for i, (name, _) in enumerate(self.columns)}
        return {"k": k, "timestamp_s": timestamp_s, **columns}

    def array(self, row: Mapping[str, Any]) -> NDArray[Any]:
        """``(N, columns)`` float64."""
        return np.array([row[name] for name, _ in self.columns], np.float64).T

    def _type(self, count: int) -> pa.DataType:
        return pa.list_(pa.field("element", pa.float64(), nullable=False))

    def _values(self, payload: memoryview) -> NDArray[Any]:
        if len(payload) % (8 * len(self.columns)):
            raise ValueError(f"{len(payload)} bytes are no whole number of messages")
        return np.frombuffer(payload, "<f8").reshape(-1, len(self.columns)).T


_BY_CONTENT: Mapping[str, type[RowSensor]] = {
    READING: RowSensor,
    DETECTIONS: DetectionSensor,
    MESSAGES: MessageSensor,
}


@cache
def row_sensor(kind: str) -> RowSensor | None:
    """The table of a kind that becomes one, ``sensors/<id>.parquet``; None for other kinds."""
    row = known_kind(kind)
    if row is None or not row.has_rows:
        return None
    return _BY_CONTENT[row.content](tuple((column.name, column.count) for column in row.columns))


def vector(length: int, *, nullable: bool = False) -> pa.DataType:
    """The type of a vector: a fixed-size list of float64; of one that may be null, a list.

    Readers of Parquet such as Arrow 25 refuse fixed-size lists that are null.
    """
    element = pa.field("element", pa.float64(), nullable=False)
    return pa.list_(element) if nullable else pa.list_(element, length)


_SCALARS: dict[str, Callable[[], pa.DataType]] = {
    "bool": pa.bool_,
    "str": pa.string,
    "json": pa.string,
    "i32": pa.int32,
    "i64": pa.int64,
    "u8": pa.uint8,
    "u32": pa.uint32,
    "u64": pa.uint64,
    "f64": pa.float64,
}


def arrow_type(name: str, *, nullable: bool) -> pa.DataType:
    """The Arrow type for a type name of the label schema (``carstage.annotation.schema``).

    Raises:
        ValueError: a name that is none.
    """
    if name in _SCALARS:
        scalar: pa.DataType = _SCALARS[name]()
        return scalar
    if name == "f64[8][2]":
        return pa.list_(pa.field("element", vector(2, nullable=True), nullable=True))
    if name.startswith("f64[") and name.endswith("]") and name[4:-1].isdigit():
        return vector(int(name[4:-1]), nullable=nullable)
    if name.endswith("[]") and name[:-2] in _SCALARS:
        return pa.list_(pa.field("element", _SCALARS[name[:-2]](), nullable=False))
    if name == "map[str,u32]":
        return pa.map_(pa.string(), pa.uint32())
    raise ValueError(f"no Arrow type for {name!r}")


def write_table(table: pa.Table, path: Path, *, keep: Sequence[bytes] = ()) -> None:
    """Write a Parquet file whose bytes depend on the table alone, whole or not at all.

    Compression, encodings and row groups are fixed; metadata of the table (pandas' index, times)
    is dropped.

    Args:
        table: the rows.
        path: of the file.
        keep: keys of metadata that stay.
    """
    given = table.schema.metadata or {}
    metadata = {key: given[key] for key in keep} or None
    with whole_file(path) as temporary:
        pq.write_table(
            table.replace_schema_metadata(metadata).combine_chunks(),
            temporary,
            row_group_size=_ROW_GROUP_ROWS,
            compression=_COMPRESSION,
            compression_level=_COMPRESSION_LEVEL,
            use_dictionary=True,
            write_statistics=True,
            version="2.6",
            data_page_version="1.0",
        )
        _name_the_writer(temporary)


def _name_the_writer(path: Path) -> None:
    """Put our name where Arrow put its own with its version, so that bytes do not follow from it.

    A Parquet file ends in its footer, the footer's length and ``PAR1``. In the footer a text is its
    length in one byte and its bytes (Thrift's compact protocol).
    """
    with path.open("r+b") as file:
        file.seek(-_TRAILER.size, os.SEEK_END)
        end = file.tell()
        size, magic = _TRAILER.unpack(file.read())
        file.seek(end - size)
        footer = file.read(size)
        found = _ARROWS_NAME.search(footer)
        if found is None or footer[found.start() - 1] != len(found[0]):
            raise StorageError(f"{path.name}: Arrow wrote a footer that is not understood.")
        head, tail = footer[: found.start() - 1], footer[found.end() :]
        footer = head + bytes([len(_WRITER)]) + _WRITER + tail
        file.seek(end - size)
        file.truncate()
        file.write(footer + _TRAILER.pack(len(footer), magic))


def read_table(path: DatasetPath) -> pa.Table:
    """Read a Parquet file.

    Raises:
        DatasetError: missing or damaged.
    """
    try:
        with os.fdopen(open_regular(path), "rb") as file:
            return table_of(file.read())
    except FileNotFoundError as error:
        raise DatasetError(f"{path.name} is missing in {path.parent}.") from error
    except (OSError, pa.ArrowException) as error:
        raise DatasetError(f"{path} is damaged: {error}") from error


def table_of(content: bytes) -> pa.Table:
    """The table that the bytes of a Parquet file hold, read from memory of Arrow's own.

    Arrow's threads may drop what they read from as late as when the interpreter ends. Were it a
    Python object, the process could abort there: apache/arrow, issues 34314 and 33975.

    Raises:
        OSError, pyarrow.ArrowException: they are damaged.
    """
    copy = pa.allocate_buffer(len(content))
    memoryview(copy).cast("B")[:] = content
    return pq.ParquetFile(pa.BufferReader(copy)).read(use_threads=False)


def require_columns(table: pa.Table, columns: Iterable[str], file: str) -> None:
    """Refuse a table that lacks one of the columns.

    Raises:
        DatasetError: names the first one that is missing.
    """
    for name in columns:
        if name not in table.column_names:
            raise DatasetError(f"{file} has no column {name}.")
