"""Do two datasets hold the same recordings? Decoded values are compared, not files.

Ids, hashes and encodings may differ, and columns that only one of them has are named. Everything
else has to be equal to the last bit: pictures, points, rows of sensors and of labels.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from carstage.dataset import Dataset, Episode


@dataclass(slots=True)
class Comparison:
    """What was compared and what differs.

    Attributes:
        data: pictures, point clouds and readings compared.
        rows: rows of label tables compared.
        differences: one sentence for each thing that differs.
        renamed: columns that only one dataset has, ``table.column``.
    """

    data: int = 0
    rows: int = 0
    differences: list[str] = field(default_factory=list)
    renamed: set[str] = field(default_factory=set)


def compare_datasets(first: Path, second: Path) -> Comparison:
    """Compare the episodes of two datasets in the order of their index.

    Raises:
        DatasetError: one of them cannot be read.
    """
    found = Comparison()
    ours, theirs = (_by_index(Dataset(path)) for path in (first, second))
    if len(ours) != len(theirs):
        found.differences.append(f"{len(ours)} episodes and {len(theirs)}")
    for one, other in zip(ours, theirs, strict=False):
        _compare_sensors(one, other, found)
        _compare_tables(one, other, found)
    return found


def _by_index(dataset: Dataset) -> list[Episode]:
    return sorted(dataset.episodes, key=lambda episode: episode.spec.index)


def _compare_sensors(one: Episode, other: Episode, found: Comparison) -> None:
    ids = [[sensor.id for sensor in episode.sensors] for episode in (one, other)]
    if ids[0] != ids[1]:
        found.differences.append(f"sensors {ids[0]} and {ids[1]}")
        return
    frames = range(min(one.frames, other.frames))
    if one.frames != other.frames:
        found.differences.append(f"{one.frames} frames and {other.frames}")
    for sensor_id in ids[0]:
        ours, theirs = one.sensor(sensor_id), other.sensor(sensor_id)
        for k in frames:
            found.data += 1
            if not _equal(ours.read(k), theirs.read(k)):
                found.differences.append(f"{sensor_id}, frame {k}")


def _equal(one: Any, other: Any) -> bool:
    """Bit for bit, NaN equal to NaN; structured arrays by their bytes."""
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and bytes(one) == bytes(other)
    return bool(one == other)


def _tables(episode: Episode) -> Iterator[tuple[str, pa.Table]]:
    yield "frames", episode.ledger()
    yield "objects", episode.objects()
    yield "camera_objects", episode.camera_objects()
    yield "ego", episode.ego()
    yield "sensor_poses", episode.sensor_poses()


def _compare_tables(one: Episode, other: Episode, found: Comparison) -> None:
    for (name, ours), (_, theirs) in zip(_tables(one), _tables(other), strict=True):
        found.rows += len(ours)
        names = set(ours.column_names) & set(theirs.column_names)
        odd = set(ours.column_names) ^ set(theirs.column_names)
        found.renamed |= {f"{name}.{column}" for column in odd}
        for column in sorted(names):
            if not ours[column].combine_chunks().equals(theirs[column].combine_chunks()):
                found.differences.append(f"table {name}, column {column}")
