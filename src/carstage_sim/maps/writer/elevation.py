"""Heights along a road: smooth curves through given heights, level at both ends."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from carstage_sim.maps.writer.cubic import Cubic, eased

Profile = tuple[Cubic, ...]

LEVEL: Profile = (Cubic(0.0, 0.0),)
"""Height zero everywhere."""


def level(height_m: float) -> Profile:
    """One height everywhere."""
    return (Cubic(0.0, height_m),)


def profile(knots: Sequence[tuple[float, float]]) -> Profile:
    """A curve through (station, height) knots in metres that never swings beyond them.

    The slopes are those of Fritsch and Butland, "A method for constructing local monotone piecewise
    cubic interpolants", SIAM J. Sci. Stat. Comput. 5 (1984): between two equal heights the road is
    level, and it has a summit only at a knot.
    """
    grades = [(z1 - z0) / (s1 - s0) for (s0, z0), (s1, z1) in pairwise(knots)]
    slopes = [0.0]
    for (before, after), ((s0, _), (s1, _), (s2, _)) in zip(
        pairwise(grades), zip(knots, knots[1:], knots[2:], strict=False), strict=True
    ):
        if before * after <= 0.0:
            slopes.append(0.0)
            continue
        w0, w1 = 2 * (s2 - s1) + (s1 - s0), (s2 - s1) + 2 * (s1 - s0)
        slopes.append((w0 + w1) / (w0 / before + w1 / after))
    slopes.append(0.0)
    pieces = [
        eased(s0, s1 - s0, (z0, z1), (slopes[i], slopes[i + 1]))
        for i, ((s0, z0), (s1, z1)) in enumerate(pairwise(knots))
    ]
    return tuple(pieces)


def height_m(heights: Profile, s_m: float) -> float:
    """Height at a station in metres."""
    return _piece(heights, s_m).value(s_m)


def grade(heights: Profile, s_m: float) -> float:
    """Slope at a station: metres of height per metre of road."""
    return _piece(heights, s_m).slope(s_m)


def _piece(heights: Profile, s_m: float) -> Cubic:
    return [piece for piece in heights if piece.start_m <= s_m or piece is heights[0]][-1]
