"""Sensors whose data are a few numbers per tick, as lines of CSV files."""

from __future__ import annotations

import csv
from contextlib import ExitStack
from pathlib import Path
from typing import Any


def row_of(kind: str, data: Any) -> tuple[float, ...] | None:
    """The numbers of a GNSS or IMU measurement; None for other sensors."""
    if kind == "gnss":
        return data.latitude, data.longitude, data.altitude
    if kind == "imu":
        a, g = data.accelerometer, data.gyroscope
        return a.x, a.y, a.z, g.x, g.y, g.z, data.compass
    return None


class RowFiles:
    """One CSV file for each such sensor; a context manager.

    Args:
        folder: where they go.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._writers: dict[str, Any] = {}
        self._files = ExitStack()

    def add(self, sensor: str, tick: int, row: tuple[float, ...]) -> None:
        """Append a line."""
        if sensor not in self._writers:
            path = self._folder / f"{sensor}.csv"
            file = self._files.enter_context(path.open("w", newline="", encoding="utf-8"))
            self._writers[sensor] = csv.writer(file)
        self._writers[sensor].writerow((tick, *row))

    def __enter__(self) -> RowFiles:
        return self

    def __exit__(self, *_: object) -> None:
        self._files.close()
