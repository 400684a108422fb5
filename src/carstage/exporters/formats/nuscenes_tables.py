"""nuScenes's tables: rows written as they come, tokens from what they name, links both ways."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from carstage.exporters.formats.nuscenes_categories import CATEGORIES
from carstage.exporters.json_rows import JsonRows

TABLES: Final = (
    "category", "attribute", "visibility", "instance", "sensor", "calibrated_sensor", "ego_pose",
    "log", "scene", "sample", "sample_data", "sample_annotation", "map",
)  # fmt: skip
LABELS: Final = ("lidarseg", "panoptic")
ATTRIBUTES: Final = {
    "vehicle.moving": "Vehicle is moving.",
    "vehicle.stopped": "Vehicle, with a driver, stands still.",
    "vehicle.parked": "Vehicle is part of the map and stands still.",
    "cycle.with_rider": "There is a rider on the bicycle or motorcycle.",
    "cycle.without_rider": "There is no rider on the bicycle or motorcycle.",
    "pedestrian.moving": "The pedestrian is moving.",
    "pedestrian.standing": "The pedestrian stands.",
    "pedestrian.sitting_lying_down": "The pedestrian sits or lies.",
}
_VISIBILITY = {"1": "v0-40", "2": "v40-60", "3": "v60-80", "4": "v80-100"}


def token(*parts: object) -> str:
    """32 hex digits that follow from the parts, unlike nuScenes's random ones."""
    return hashlib.sha256("\0".join(map(str, parts)).encode()).hexdigest()[:32]


class Tables:
    """The thirteen files, and two more where points are labelled.

    Args:
        folder: where they go.
        labelled: whether there are labels of points.
    """

    def __init__(self, folder: Path, *, labelled: bool = False) -> None:
        names = (*TABLES, *(LABELS if labelled else ()))
        self._rows = {name: JsonRows(folder / f"{name}.json") for name in names}
        self._written: set[str] = set()
        for index, name in enumerate(CATEGORIES):
            row = {"token": token("category", name), "name": name, "description": ""}
            self.add("category", {**row, "index": index})
        for name, description in ATTRIBUTES.items():
            row = {"token": token("attribute", name), "name": name, "description": description}
            self.add("attribute", row)
        for number, level in _VISIBILITY.items():
            text = "share of pixels seen, over all cameras"
            self.add("visibility", {"token": number, "level": level, "description": text})

    def add(self, table: str, row: Mapping[str, Any]) -> str:
        """Append a row; returns its token."""
        self._rows[table].add(row)
        found: str = row["token"]
        return found

    def add_once(self, table: str, row: Mapping[str, Any]) -> str:
        """Append a row unless its token was written this way; for the few shared rows."""
        if row["token"] not in self._written:
            self._written.add(row["token"])
            self.add(table, row)
        found: str = row["token"]
        return found

    def close(self) -> None:
        """End all arrays."""
        for rows in self._rows.values():
            rows.close()


class Chain:
    """Rows of one table that name the one before and the one after, of one thing over time.

    A row is written when the next one is known, so that one row waits, not all.
    """

    def __init__(self, tables: Tables, table: str) -> None:
        self._tables, self._table = tables, table
        self._waiting: dict[str, Any] | None = None
        self.first = ""
        self.last = ""
        self.count = 0

    def add(self, row: Mapping[str, Any]) -> None:
        """Append a row, which has a token."""
        if self._waiting is not None:
            self._tables.add(self._table, {**self._waiting, "next": row["token"]})
        self._waiting = {**row, "prev": self.last}
        self.first = self.first or row["token"]
        self.last = row["token"]
        self.count += 1

    def end(self) -> None:
        """Write the row that waits, as the last one."""
        if self._waiting is not None:
            self._tables.add(self._table, {**self._waiting, "next": ""})
            self._waiting = None
