"""The lanes of a map as a JSON document: what a top view draws below the tracks."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from carstage_sim.maps import Town

_OFF_M = 0.05  # how far a line may leave the samples
_CENTIMETRES = 2


def map_lanes(town: Town) -> dict[str, Any]:
    """The document that ``--lanes`` prints.

    Args:
        town: the baked map.

    Returns:
        ``lanes``: centre lines of the driving lanes as lists of x, y (world metres, in the
        direction of travel), with as few points as their bends need; ``widths_m`` of each;
        ``in_junction`` of each.
    """
    samples = town.lanes
    along_m = np.where(samples.lane_id > 0, -samples.s_m, samples.s_m)
    order = np.lexsort((along_m, samples.lane_id, samples.section_id, samples.road_id))
    keys = np.stack([samples.road_id, samples.section_id, samples.lane_id])[:, order]
    begins = np.flatnonzero((keys[:, 1:] != keys[:, :-1]).any(axis=0)) + 1
    lanes, widths_m, in_junction = [], [], []
    for run in np.split(order, begins):
        if len(run) < 2:
            continue
        line = shapely.LineString(samples.location[run, :2]).simplify(_OFF_M)
        points = shapely.get_coordinates(line)
        lanes.append([[round(float(v), _CENTIMETRES) for v in point] for point in points])
        widths_m.append(round(float(np.median(samples.width_m[run])), _CENTIMETRES))
        in_junction.append(bool(samples.junction_id[run[0]] >= 0))
    return {"map": town.name, "lanes": lanes, "widths_m": widths_m, "in_junction": in_junction}
