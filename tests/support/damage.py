"""Damage to a recorded dataset, after which its marker fits the files again."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from analytic_dataset import attempt_of, edit_rows, recommit
from carstage.codecs.npz import pack_npz, unpack_npz
from carstage.codecs.png import PngPacker, unpack_png
from recorded_dataset import FRAMES, replace_file

Row = dict[str, Any]
Damage = Callable[[Path], None]
FRAME = 4
"""Where single rows are damaged."""


def edit_one(table: str, change: Callable[[Row], object], pick: Callable[[Row], bool]) -> Damage:
    """Change the first row of ``FRAME`` that is picked."""

    def damage(drive: Path) -> None:
        def edit(rows: list[Row]) -> list[Row]:
            change(next(row for row in rows if row["k"] == FRAME and pick(row)))
            return rows

        edit_rows(drive, f"{table}.parquet", edit)

    return damage


def edit_all(table: str, change: Callable[[Row], object]) -> Damage:
    """Change every row."""

    def damage(drive: Path) -> None:
        def edit(rows: list[Row]) -> list[Row]:
            for row in rows:
                change(row)
            return rows

        edit_rows(drive, f"{table}.parquet", edit)

    return damage


def put(column: str, value: Callable[[Any], Any]) -> Callable[[Row], object]:
    def change(row: Row) -> None:
        row[column] = value(row[column])

    return change


def moved(metres: float, axis: int = 0) -> Callable[[Any], Any]:
    return lambda v: [x + metres * (i == axis) for i, x in enumerate(v)]


def scaled(factor: float) -> Callable[[Any], Any]:
    return lambda v: [x * factor for x in v] if isinstance(v, list) else v * factor


def turned(radians: float) -> Callable[[float], float]:
    return lambda v: float((v + radians + np.pi) % (2.0 * np.pi) - np.pi)


def document(name: str, change: Callable[[Any], object]) -> Damage:
    def damage(drive: Path) -> None:
        path = attempt_of(drive) / name
        content = json.loads(path.read_text())
        change(content)
        path.write_text(json.dumps(content))
        recommit(drive)

    return damage


def pictures(
    sensor: str, change: Callable[[Any], Any], frames: tuple[int, ...] = tuple(range(FRAMES))
) -> Damage:
    def damage(drive: Path) -> None:
        for k in frames:
            for path in (attempt_of(drive) / "sensors" / sensor).glob(f"{k:06d}.*png"):
                replace_file(path, PngPacker().pack(change(unpack_png(path.read_bytes()))))
        recommit(drive)

    return damage


def flow_fields(change: Callable[[Any], Any]) -> Damage:
    def damage(drive: Path) -> None:
        for path in (attempt_of(drive) / "sensors" / "FLOW_FRONT").glob("*.npz"):
            field = unpack_npz(path.read_bytes(), "flow")
            replace_file(path, pack_npz({"flow": np.ascontiguousarray(change(field))}))
        recommit(drive)

    return damage


def sweeps(change: Callable[[Any], None]) -> Damage:
    def damage(drive: Path) -> None:
        for path in (attempt_of(drive) / "sensors" / "LIDAR_TOP").glob("*.bin"):
            points = np.fromfile(path, "<f4").reshape(-1, 4)
            change(points)
            replace_file(path, points.tobytes())
        recommit(drive)

    return damage
