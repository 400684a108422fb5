"""Counts over the labels of all episodes, for the report's charts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.reading import Episode

DISTANCE_EDGES_M = (0, 10, 20, 30, 40, 50, 60, 80)
LIDAR_EDGES = (0, 1, 5, 20, 100, 500)
OCCLUSION_NAMES = ("0 mostly visible", "1 partly", "2 largely", "3 unknown")


@dataclass(slots=True)
class LabelStatistics:
    """What the label tables hold.

    Attributes:
        records: rows of ``objects.parquet`` without the ego.
        tracks: different objects without the egos.
        by_class: objects (tracks) by class.
        visible: rows of ``camera_objects.parquet`` that are visible.
        distances: of visible objects, counts per bin of ``DISTANCE_EDGES_M``.
        occluded: counts per level of STAGE-VO.
        occluded_px: counts per level by pixels.
        lidar_points: objects by summed LiDAR points, counts per bin of ``LIDAR_EDGES``.
    """

    records: int = 0
    tracks: int = 0
    by_class: Counter[str] = field(default_factory=Counter)
    visible: int = 0
    distances: list[int] = field(default_factory=lambda: [0] * len(DISTANCE_EDGES_M))
    occluded: list[int] = field(default_factory=lambda: [0] * 4)
    occluded_px: list[int] = field(default_factory=lambda: [0] * 4)
    lidar_points: list[int] = field(default_factory=lambda: [0] * len(LIDAR_EDGES))


def bin_names(edges: Sequence[int], unit: str) -> list[str]:
    """``0-10 m``, …, ``80+ m`` for the bins that begin at the edges."""
    closed = []
    for low, high in pairwise(edges):
        last = high if unit else high - 1  # counts are whole, distances are not
        closed.append(f"{low}{unit}" if low == last else f"{low}–{last}{unit}")
    return [*closed, f"{edges[-1]}+{unit}"]


def count_labels(episodes: Sequence[Episode]) -> LabelStatistics:
    """Count over all episodes.

    Raises:
        DatasetError: a table is missing or damaged.
    """
    statistics = LabelStatistics()
    for episode in episodes:
        classes: dict[int, str] = {}
        columns = ["track_id", "class", "is_ego", "num_lidar_points"]
        points: list[int] = []
        for row in episode.objects().select(columns).to_pylist():
            if row["is_ego"]:
                continue
            statistics.records += 1
            classes[row["track_id"]] = row["class"]
            if row["num_lidar_points"]:  # else no LiDAR, or no box to count in
                points.append(sum(count for _, count in row["num_lidar_points"]))
        statistics.tracks += len(classes)
        statistics.by_class.update(classes.values())
        _add(statistics.lidar_points, np.array(points), LIDAR_EDGES)
        table = episode.camera_objects()
        seen = table.filter(table["visible"])
        statistics.visible += seen.num_rows
        _add(statistics.distances, seen["distance"].to_numpy(), DISTANCE_EDGES_M)
        _add(statistics.occluded, seen["occluded"].to_numpy(), range(4))
        _add(statistics.occluded_px, seen["occluded_px"].to_numpy(), range(4))
    return statistics


def _add(totals: list[int], values: NDArray[Any], edges: Sequence[int]) -> None:
    counts, _ = np.histogram(values, [*edges, np.inf])
    for index, count in enumerate(counts.tolist()):
        totals[index] += count
