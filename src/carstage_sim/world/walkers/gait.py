"""Which pose of its gait a pedestrian is in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.walking import (
    RUN_PHASES,
    WALK_PHASES,
    Vector,
    gait_at,
    size_m,
    stride_m,
)
from carstage_sim.content.wheelchairs import ROLL_PHASES, roll_m


def walk_phase(
    actor_id: int,
    location: NDArray[np.float64],
    yaw_deg: float,
    velocity: NDArray[np.float64],
    extent: Vector,
) -> int:
    """Phase of a figure as :func:`carstage_sim.content.walking.joints_at` counts them.

    A function of this frame alone: the legs move with the way along the heading, so that a foot on
    the ground stays where it is. ``extent`` is that of the walker's box.
    """
    size = size_m(extent)
    gait = gait_at(size, float(np.hypot(velocity[0], velocity[1])))
    if gait == "stand":
        return 0
    turns = _way_m(location, yaw_deg) / stride_m(size, gait) + actor_id * 0.37
    first, count = (0, WALK_PHASES) if gait == "walk" else (WALK_PHASES, RUN_PHASES)
    return first + 1 + int(turns % 1.0 * count) % count


def roll_phase(actor_id: int, location: NDArray[np.float64], yaw_deg: float) -> int:
    """Phase of who is in a wheelchair, whose wheels turn with the way along the heading."""
    turns = _way_m(location, yaw_deg) / roll_m() + actor_id * 0.37
    return 1 + int(turns % 1.0 * ROLL_PHASES) % ROLL_PHASES


def _way_m(location: NDArray[np.float64], yaw_deg: float) -> float:
    yaw = np.radians(yaw_deg)
    return float(location[0] * np.cos(yaw) + location[1] * np.sin(yaw))
