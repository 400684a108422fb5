"""Which pose of its walk a pedestrian is in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.pedestrians import PHASES

_STRIDE_M = 1.35
"""Way of two steps; the legs swing with the distance walked."""
_STANDING_M_S = 0.15


def walk_phase(
    actor_id: int,
    location: NDArray[np.float64],
    yaw_deg: float,
    velocity: NDArray[np.float64],
) -> int:
    """Phase of the walk, 0 for standing, else 1 to 8; a function of this frame alone."""
    speed = float(np.hypot(velocity[0], velocity[1]))
    if speed < _STANDING_M_S:
        return 0
    yaw = np.radians(yaw_deg)
    way = location[0] * np.cos(yaw) + location[1] * np.sin(yaw)
    turns = float(way) / _STRIDE_M + actor_id * 0.37
    return 1 + int(turns % 1.0 * PHASES) % PHASES
