"""Columns of a table compared with what follows from other columns and files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import ArrayLike, NDArray

from carstage.geometry import FloatArray
from carstage.validation.checks.findings import Findings


def numbers(table: pa.Table, column: str, *shape: int) -> FloatArray:
    """A column as ``(N, *shape)`` float64; NaN where it is null."""
    flat = _flat_numbers(table[column], shape)
    if flat is not None:
        return flat
    nothing = np.full(shape, np.nan)
    found = [nothing if v is None else _with_nan(v) for v in entries(table, column)]
    if not found:
        return np.empty((0, *shape))
    return np.array(found, dtype=np.float64).reshape(len(found), *shape)


def _flat_numbers(column: Any, shape: tuple[int, ...]) -> FloatArray | None:
    """``numbers`` of a column of numbers, or of lists of them of that length; None of others."""
    present = column.drop_null()
    if len(shape) == 1 and (
        pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type)
    ):
        if (pc.list_value_length(present).to_numpy() != shape[0]).any():
            return None
        present = pc.list_flatten(present)
    elif shape:
        return None
    if not (pa.types.is_integer(present.type) or pa.types.is_floating(present.type)):
        return None
    found = np.full((len(column), *shape), np.nan)
    found[column.is_valid().to_numpy()] = present.to_numpy().reshape(-1, *shape)
    return found


def entries(table: pa.Table, column: str) -> list[Any]:
    """A column as Python's own values."""
    found: list[Any] = table[column].to_pylist()
    return found


def rows_at(table: pa.Table, indices: Sequence[int]) -> pa.Table:
    """Some rows of a table, perhaps none."""
    return table.take(pa.array(indices, pa.int64()))


def _with_nan(value: Any) -> Any:
    if isinstance(value, list):
        return [_with_nan(part) for part in value]
    return np.nan if value is None else value


class Recomputed:
    """Reports columns whose values are not those that follow; one line for each column.

    Args:
        check: name of the check.
        file: the table's name.
        rows: the table, or the rows of it that are compared; names them in messages.
        findings: where differences go.
        sensor: whose table it is, if it is one sensor's.
    """

    def __init__(
        self,
        check: str,
        file: str,
        rows: pa.Table,
        findings: Findings,
        *,
        sensor: str | None = None,
    ) -> None:
        self._sensor = sensor
        self._check = check
        self._file = file
        self._rows = rows
        self._findings = findings

    def column(
        self,
        name: str,
        expected: ArrayLike,
        tolerance: ArrayLike,
        *,
        recorded: ArrayLike | None = None,
        period: float | None = None,
        either_sign: bool = False,
        where: NDArray[np.bool_] | None = None,
    ) -> None:
        """Compare one column with what follows.

        Args:
            name: of the column.
            expected: ``(N, ...)``; rows with NaN are not compared.
            tolerance: the largest difference that is allowed, ``(N,)`` or one for all.
            recorded: ``(N, ...)``; default: the table's column.
            period: of angles, in their unit.
            either_sign: a value and its negative mean the same, as for quaternions.
            where: ``(N,)`` rows to compare; default: all.
        """
        wanted = np.asarray(expected, dtype=np.float64)
        if not len(wanted):
            return
        if recorded is None:
            recorded = numbers(self._rows, name, *wanted.shape[1:])
        found = np.asarray(recorded, dtype=np.float64)
        difference = found - wanted
        if period is not None:
            difference = (difference + period / 2.0) % period - period / 2.0
        size = _size(difference)
        if either_sign:
            size = np.minimum(size, _size(found + wanted))
        missing = np.isnan(found).reshape(len(found), -1).any(axis=1)
        known = ~np.isnan(wanted).reshape(len(wanted), -1).any(axis=1)
        wrong = known & (missing | (size > np.asarray(tolerance, dtype=np.float64)))
        if where is not None:
            wrong &= where
        self.rows(name, wrong, found, wanted)

    def rows(
        self,
        name: str,
        wrong: NDArray[np.bool_],
        found: Sequence[Any] | NDArray[Any],
        wanted: Sequence[Any] | NDArray[Any],
    ) -> None:
        """Report the first row that is wrong, and how many are."""
        if not wrong.any():
            return
        first = int(np.argmax(wrong))
        columns = self._rows.column_names
        row = {c: self._rows[c][first].as_py() for c in ("k", "track_id", "sensor_id")
               if c in columns}  # fmt: skip
        of = f" of object {row['track_id']}" if "track_id" in row else ""
        self._findings.add(
            self._check,
            f"{self._file}: {name}{of} is {_shown(found[first])}, from the rest of the dataset "
            f"follows {_shown(wanted[first])}; {int(wrong.sum())} of {len(wrong)} rows differ",
            frame=row.get("k"),
            sensor=row.get("sensor_id", self._sensor),
        )


def _size(values: NDArray[np.float64]) -> NDArray[np.float64]:
    flat: NDArray[np.float64] = np.abs(values).reshape(len(values), -1).max(axis=1, initial=0.0)
    return flat


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return "(" + ", ".join(f"{v:.6g}" for v in value.reshape(-1)[:4].tolist()) + ")"
    return f"{value:.6g}" if isinstance(value, (float, np.floating)) else repr(value)
