"""Accelerations that what is ahead asks for, m/s². The least of them is driven."""

from __future__ import annotations

from math import sqrt

from carstage.spec import ComfortSpec

REACTION_S = 0.6
"""A speed that is to be kept at a place is followed with this time constant."""
_LATE_S = 0.4
"""Until the brakes do what is wished."""
_FREE_S = 1.5
"""The same for the speed limit."""
CREEPING_M_S = 0.5
"""Up to where the Traffic Manager itself stops. Of no desired speed does it make that a car stands:
at a stand it makes full throttle of each."""
HELD_M_S = 0.5
"""Who is slower behind another is stopped by the Traffic Manager."""
STANDING_GAP_M = 3.0
_CLOSE_M = 0.1


def on_free_road(comfort: ComfortSpec, speed_m_s: float, limit_m_s: float) -> float:
    """To drive as fast as is allowed."""
    return min(comfort.acceleration_m_s2, (limit_m_s - speed_m_s) / _FREE_S)


def to_be_slower(
    comfort: ComfortSpec, speed_m_s: float, there_m_s: float, distance_m: float
) -> float:
    """To drive not faster than some speed at a place ahead.

    The speed that still allows it grows with the root of the distance. It is followed with a time
    constant, which the distance is shortened by. Who learns of the place late brakes evenly.
    """
    left_m = max(distance_m - REACTION_S * speed_m_s, 0.0)
    allowed_m_s = sqrt(there_m_s * there_m_s + 2.0 * comfort.acceleration_m_s2 * left_m)
    wish = (allowed_m_s - speed_m_s) / REACTION_S
    if wish >= -comfort.acceleration_m_s2:
        return wish
    late_m = max(distance_m - _LATE_S * speed_m_s, _CLOSE_M)
    even = (speed_m_s * speed_m_s - there_m_s * there_m_s) / (2.0 * late_m)
    return max(wish, -max(even, comfort.acceleration_m_s2))


def to_follow(comfort: ComfortSpec, speed_m_s: float, other_m_s: float, gap_m: float) -> float:
    """To stay behind another: the interaction of the Intelligent Driver Model.

    Treiber, Hennecke and Helbing, "Congested traffic states in empirical observations and
    microscopic simulations", Phys. Rev. E 62 (2000), 1805.
    """
    closing = speed_m_s * (speed_m_s - other_m_s) / (2.0 * comfort.acceleration_m_s2)
    wanted_m = STANDING_GAP_M + max(speed_m_s * comfort.gap_s + closing, 0.0)
    share = wanted_m / max(gap_m, _CLOSE_M)
    return comfort.acceleration_m_s2 * (1.0 - share * share)
