"""The lanes of a map as a JSON document: what a top view draws, and where vehicles may begin."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from carstage_sim.maps import Town

_OFF_M = 0.05  # how far a line may leave the samples
_CENTIMETRES = 2


def map_lanes(town: Town) -> dict[str, Any]:
    """The document that ``--lanes`` prints.

    Args:
        town: the baked map.

    Returns:
        ``lanes``: centre lines of the driving lanes as lists of x, y (world metres, in the
        direction of travel), with as few points as their bends and slopes need; ``heights_m`` of
        their points; ``widths_m`` of each; ``in_junction`` of each. ``spawn_points`` as lists of
        x, y, z (m) and yaw (deg), in the order of their numbers.
    """
    samples = town.lanes
    along_m = np.where(samples.lane_id > 0, -samples.s_m, samples.s_m)
    order = np.lexsort((along_m, samples.lane_id, samples.section_id, samples.road_id))
    keys = np.stack([samples.road_id, samples.section_id, samples.lane_id])[:, order]
    begins = np.flatnonzero((keys[:, 1:] != keys[:, :-1]).any(axis=0)) + 1
    lanes, heights_m, widths_m, in_junction = [], [], [], []
    for run in np.split(order, begins):
        if len(run) < 2:
            continue
        points = _fewest(samples.location[run])
        lanes.append([_rounded(point[:2]) for point in points])
        heights_m.append(_rounded(points[:, 2]))
        widths_m.append(round(float(np.median(samples.width_m[run])), _CENTIMETRES))
        in_junction.append(bool(samples.junction_id[run[0]] >= 0))
    return {
        "map": town.name,
        "lanes": lanes,
        "heights_m": heights_m,
        "widths_m": widths_m,
        "in_junction": in_junction,
        "spawn_points": [_rounded(place) for place in town.spawn_points[:, [0, 1, 2, 4]]],
    }


def _fewest(points: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """Those of ``(N, 3)`` points that a line needs from above or from the side."""
    number = np.arange(len(points), dtype=np.float64)
    above = shapely.LineString(np.column_stack([points[:, :2], number])).simplify(_OFF_M)
    # Samples are a metre apart: their number is the way along the lane.
    beside = shapely.LineString(np.column_stack([number, points[:, 2]])).simplify(_OFF_M)
    kept = np.union1d(
        shapely.get_coordinates(above, include_z=True)[:, 2], shapely.get_coordinates(beside)[:, 0]
    )
    return points[kept.astype(np.int64)]


def _rounded(values: NDArray[np.floating[Any]]) -> list[float]:
    return [round(float(value), _CENTIMETRES) for value in values]
