"""The V2X messages that an episode's sensors received, one row each."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from carstage.dataset.tables import row_sensor
from carstage.errors import DatasetError

if TYPE_CHECKING:
    from carstage.dataset.reading import Sensor

V2X = "v2x"
"""The kind of sensor whose messages have these columns; those of other packages have their own."""
_WHOLE = {"station_id": pa.int64(), "station_type": pa.int32(), "drive_direction": pa.int32()}
"""Columns of whole numbers; the others are float64."""


def message_table(sensors: Iterable[Sensor]) -> pa.Table | None:
    """What the V2X sensors of an episode received; ``None`` where it has no such sensor.

    Args:
        sensors: of the episode; others are left out.

    Returns:
        A row for each message, by sensor and frame: ``k``, ``timestamp_s`` (when it was received),
        ``sensor_id``, ``track_id`` (of the sender, ``station_id`` as the tables of labels have it),
        and the columns of the sensor's own table; null for what a message does not say.

    Raises:
        DatasetError: a table is missing or damaged.
    """
    radios = [sensor for sensor in sensors if sensor.kind == V2X]
    if not radios:
        return None
    return pa.concat_tables(_rows(sensor) for sensor in radios)


def _rows(sensor: Sensor) -> pa.Table:
    file = f"sensors/{sensor.id}.parquet"
    row_kind = row_sensor(sensor.kind)
    if row_kind is None or not sensor.table.schema.equals(row_kind.schema):
        raise DatasetError(f"{file} has other columns than those of a V2X sensor.")
    names = [name for name, _ in row_kind.columns]
    found: dict[str, list[Any]] = {name: [] for name in ("k", "timestamp_s", *names)}
    for row in sensor.table.to_pylist():
        count = len(row[names[0]])
        if any(len(row[name]) != count for name in names):
            raise DatasetError(f"{file}: columns of frame {row['k']} differ in their length.")
        found["k"] += [row["k"]] * count
        found["timestamp_s"] += [row["timestamp_s"]] * count
        for name in names:
            found[name] += [value if math.isfinite(value) else None for value in row[name]]
    columns = {
        "k": pa.array(found["k"], pa.int32()),
        "timestamp_s": pa.array(found["timestamp_s"], pa.float64()),
        "sensor_id": pa.array([sensor.id] * len(found["k"]), pa.string()),
        "track_id": _whole(found["station_id"], pa.int64(), file),
    }
    for name in names:
        kind = _WHOLE.get(name)
        columns[name] = (
            pa.array(found[name], pa.float64()) if kind is None else _whole(found[name], kind, file)
        )
    return pa.table(columns)


def _whole(values: list[Any], kind: pa.DataType, file: str) -> pa.Array[Any]:
    whole = [None if value is None else round(value) for value in values]
    try:
        return pa.array(whole, kind)
    except (OverflowError, pa.ArrowInvalid) as error:
        raise DatasetError(f"{file} is damaged: {error}") from error
