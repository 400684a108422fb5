"""Spawn points: places on driving lanes where a vehicle can be set down."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.levels import CLEARANCE_M
from carstage_sim.maps.strips import Strip

SPACING_M = 8.5
"""Between any two, in whichever lanes."""
AFTER_JUNCTION_M = 8.0
BEFORE_JUNCTION_M = 18.0
"""Room before a junction: clear of the stop line and of the light's trigger boxes."""
HEIGHT_M = 0.5
_NARROWEST_LANE_M = 2.0
MOST_POINTS = 1500
_STEP_M = 0.5


def spawn_points(lanes: list[Strip], rng: np.random.Generator) -> NDArray[np.float64]:
    """``(N, 6)`` x, y, z (m), pitch, yaw, roll (deg), in an order that scatters them over the map.

    Users take the first N of the list; in road order they would all land in one street.
    """
    rows: list[tuple[float, ...]] = []
    taken: dict[tuple[int, int], list[tuple[float, float, float]]] = {}
    for lane in lanes:
        if lane.kind != "driving" or lane.junction_id != -1:
            continue
        along_m = lane.along_m
        if along_m[-1] <= AFTER_JUNCTION_M + BEFORE_JUNCTION_M:
            continue
        yaw = np.degrees(np.unwrap(np.radians(lane.yaw_deg)))
        stations = np.arange(AFTER_JUNCTION_M, along_m[-1] - BEFORE_JUNCTION_M, _STEP_M)
        x, y = (np.interp(stations, along_m, lane.center[:, k]) for k in range(2))
        z = np.interp(stations, along_m, lane.z_m)
        # Where a road goes on after its course has ended, samples stand still.
        moves = np.diff(along_m, prepend=-1.0) > 0.0
        slope = np.gradient(lane.z_m[moves], along_m[moves])
        pitch = np.degrees(np.arctan(np.interp(stations, along_m[moves], slope)))
        heading = (np.interp(stations, along_m, yaw) + 180.0) % 360.0 - 180.0
        wide = np.interp(stations, along_m, lane.width_m) >= _NARROWEST_LANE_M
        for i in np.flatnonzero(wide).tolist():
            place = (float(x[i]), float(y[i]), float(z[i]))
            cell = (int(place[0] // SPACING_M), int(place[1] // SPACING_M))
            if _is_near(place, cell, taken):
                continue
            taken.setdefault(cell, []).append(place)
            rows.append((*place[:2], place[2] + HEIGHT_M, float(pitch[i]), float(heading[i]), 0.0))
    points = np.array(rows, dtype=np.float64).reshape(-1, 6)
    return points[rng.permutation(len(points))][:MOST_POINTS]


def _is_near(
    place: tuple[float, float, float],
    cell: tuple[int, int],
    taken: dict[tuple[int, int], list[tuple[float, float, float]]],
) -> bool:
    """Whether a point in this cell or beside it is too close; other levels do not count."""
    return any(
        math.dist(place[:2], other[:2]) < SPACING_M and abs(place[2] - other[2]) < CLEARANCE_M
        for dx in (-1, 0, 1)
        for dy in (-1, 0, 1)
        for other in taken.get((cell[0] + dx, cell[1] + dy), ())
    )
