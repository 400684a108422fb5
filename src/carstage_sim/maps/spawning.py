"""Spawn points: places on driving lanes where a vehicle can be set down."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.strips import Strip

SPACING_M = 8.5
"""Between any two, in whichever lanes."""
AFTER_JUNCTION_M = 8.0
BEFORE_JUNCTION_M = 18.0
"""Room before a junction: clear of the stop line and of the light's trigger boxes."""
HEIGHT_M = 0.5
_STEP_M = 0.5


def spawn_points(lanes: list[Strip], rng: np.random.Generator) -> NDArray[np.float64]:
    """``(N, 6)`` x, y, z (m), pitch, yaw, roll (deg), in an order that scatters them over the map.

    Users take the first N of the list; in road order they would all land in one street.
    """
    rows: list[tuple[float, ...]] = []
    places = np.empty((0, 2))
    for lane in lanes:
        if lane.kind != "driving" or lane.junction_id != -1:
            continue
        steps = np.linalg.norm(np.diff(lane.center, axis=0), axis=1)
        along_m = np.concatenate([[0.0], np.cumsum(steps)])
        yaw = np.degrees(np.unwrap(np.radians(lane.yaw_deg)))
        for s_m in np.arange(AFTER_JUNCTION_M, along_m[-1] - BEFORE_JUNCTION_M, _STEP_M):
            place = np.array([np.interp(s_m, along_m, lane.center[:, k]) for k in range(2)])
            if len(places) and np.linalg.norm(places - place, axis=1).min() < SPACING_M:
                continue
            places = np.vstack([places, place])
            heading = (float(np.interp(s_m, along_m, yaw)) + 180.0) % 360.0 - 180.0
            rows.append((float(place[0]), float(place[1]), HEIGHT_M, 0.0, heading, 0.0))
    points = np.array(rows, dtype=np.float64).reshape(-1, 6)
    return points[rng.permutation(len(points))]
