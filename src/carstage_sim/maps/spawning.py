"""Spawn points: places on driving lanes where a vehicle can be set down."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.strips import Strip

SPACING_M = 9.0
AFTER_JUNCTION_M = 8.0
BEFORE_JUNCTION_M = 18.0
"""Room before a junction: clear of the stop line and of the light's trigger boxes."""
HEIGHT_M = 0.5


def spawn_points(lanes: list[Strip], rng: np.random.Generator) -> NDArray[np.float64]:
    """``(N, 6)`` x, y, z (m), pitch, yaw, roll (deg), in an order that scatters them over the map.

    Users take the first N of the list; in road order they would all land in one street.
    """
    rows = []
    for lane in lanes:
        if lane.kind != "driving" or lane.junction_id != -1:
            continue
        steps = np.linalg.norm(np.diff(lane.center, axis=0), axis=1)
        along_m = np.concatenate([[0.0], np.cumsum(steps)])
        room_m = along_m[-1] - AFTER_JUNCTION_M - BEFORE_JUNCTION_M
        if room_m < 0:
            continue
        stations = AFTER_JUNCTION_M + SPACING_M * np.arange(int(room_m // SPACING_M) + 1)
        yaw = np.degrees(np.unwrap(np.radians(lane.yaw_deg)))
        for s_m in stations:
            x, y = (float(np.interp(s_m, along_m, lane.center[:, k])) for k in range(2))
            heading = float(np.interp(s_m, along_m, yaw))
            rows.append((x, y, HEIGHT_M, 0.0, (heading + 180.0) % 360.0 - 180.0, 0.0))
    points = np.array(rows, dtype=np.float64).reshape(-1, 6)
    return points[rng.permutation(len(points))]
