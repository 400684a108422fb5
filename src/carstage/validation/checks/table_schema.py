"""Tables have the columns and types of the format: other checks compare what they hold."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from carstage.annotation.schema import Column
from carstage.dataset.tables import arrow_type, require_columns
from carstage.errors import DatasetError

_ADDED_LATER = {"outside_px"}
"""Columns that datasets of version 0.1 lack."""
_LENGTH = re.compile(r"\[(\d+)\]")
_LEDGER_COLUMNS = (
    Column("tick", "i32", "", "step of the episode"),
    Column("k", "i32", "", "saved frame; null: the tick was not saved", nullable=True),
    Column("server_frame", "i64", "", "the server's number of the frame"),
    Column("timestamp_s", "f64", "s", "simulated time"),
)
"""Those that the ledger has whatever the sensors are."""


def require_schema(table: pa.Table, columns: Sequence[Column], file: str) -> None:
    """Refuse a table in which columns are missing, or hold something else than they should.

    Arrow's variants of a type are one: lists of fixed size or not, integers of any size. Numbers
    that may be null may be whole floats, and be without type where all are null: pandas writes so.

    Raises:
        DatasetError: names the first column.
    """
    require_columns(table, [one.name for one in columns if one.name not in _ADDED_LATER], file)
    for column in columns:
        if column.name not in table.column_names:
            continue
        values: Any = table[column.name]
        if not _fits(values, column):
            what = f"{values.type}, not {column.type}"
        elif not _is_whole(values, column):
            what = f"lists that are no {column.type}"
        elif column.type == "json" and not all(map(_is_object, values.drop_null().to_pylist())):
            what = "text that is no JSON object"
        else:
            continue
        raise DatasetError(f"{file}: column {column.name} holds {what}.")


def require_rows(table: pa.Table, columns: Sequence[Column], file: str) -> None:
    """Refuse a table by :func:`require_schema` or :func:`require_values`.

    Raises:
        DatasetError: names the first column.
    """
    require_schema(table, columns, file)
    require_values(table, columns, file)


def require_ledger(ledger: pa.Table) -> pa.Table:
    """A ledger that has times and numbers.

    Raises:
        DatasetError: names the first column that it lacks, or that holds something else.
    """
    require_rows(ledger, _LEDGER_COLUMNS, "frames.parquet")
    return ledger


def require_values(table: pa.Table, columns: Sequence[Column], file: str) -> None:
    """Refuse a table that lacks a value where none may be missing, or has NaN or infinity.

    What is not known is null. A comparison with NaN finds nothing.

    Raises:
        DatasetError: names the first column.
    """
    for column in columns:
        if column.name not in table.column_names:
            continue
        values: Any = table[column.name]
        if values.null_count and not column.nullable:
            raise DatasetError(f"{file}: {column.name} is null in {values.null_count} rows.")
        while _is_list(values.type):
            values = pc.list_flatten(values)
        if pa.types.is_floating(values.type):
            strange = pc.sum(pc.invert(pc.is_finite(values))).as_py()
            if strange:
                raise DatasetError(f"{file}: {column.name} holds {strange} NaN or infinite values.")


def _fits(values: Any, column: Column) -> bool:
    """Whether a column's type is as good as that of the format."""
    wanted = arrow_type(column.type, nullable=column.nullable)
    if column.nullable and pa.types.is_null(values.type):
        return True
    if column.nullable and pa.types.is_integer(wanted) and pa.types.is_floating(values.type):
        return not pc.any(pc.not_equal(values, pc.floor(values))).as_py()
    return _fit(values.type, wanted)


def _fit(found: Any, wanted: Any) -> bool:
    types = pa.types
    if types.is_floating(wanted):
        return types.is_floating(found) or types.is_integer(found)
    if types.is_integer(wanted):
        return types.is_integer(found)
    if types.is_string(wanted):
        return types.is_string(found) or types.is_large_string(found)
    if _is_list(wanted):
        return _is_list(found) and _fit(found.value_type, wanted.value_type)
    if types.is_map(wanted):
        return types.is_map(found) and all(
            _fit(a, b)
            for a, b in (
                (found.key_type, wanted.key_type),
                (found.item_type, wanted.item_type),
            )
        )
    return bool(found == wanted)


def _is_list(type_: Any) -> bool:
    types = pa.types
    return bool(
        types.is_list(type_) or types.is_large_list(type_) or types.is_fixed_size_list(type_)
    )


def _is_whole(values: Any, column: Column) -> bool:
    """Whether lists have the length that their type says, and no gaps."""
    lengths = [int(length) for length in _LENGTH.findall(column.type)]
    depth = column.type.count("[") - column.type.startswith("map")
    for level in range(depth):
        values = values.drop_null()
        if pa.types.is_null(values.type):
            return True
        if lengths and set(pc.list_value_length(values).unique().to_pylist()) - {lengths[level]}:
            return False
        values = pc.list_flatten(values)
        if values.null_count and level == depth - 1:
            return False
    return True


def _is_object(text: str) -> bool:
    try:
        return isinstance(json.loads(text), dict)
    except ValueError:
        return False
