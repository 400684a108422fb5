"""Centre lines as nuScenes's arcline paths: arcs and straight pieces one after the other.

The devkit's ``arcline_path_utils.py`` says what they are: up to three turns of one radius, ``L``,
``S`` or ``R``. Here each path is a single arc; the other turns have no length.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from carstage.geometry import FloatArray, wrap_angle
from carstage.lane_lines.town import with_steps

TOLERANCE_M: Final = 0.02
"""How far a point of a centre line may be from its path."""
SHORTEST_M: Final = 0.01
_STRAIGHT_RADIUS_M: Final = 1000.0
"""Of a straight path, where it means nothing; nuScenes has such a number too."""
_FLATTEST_PER_M: Final = 1e-5
_DIGITS: Final = 6
_LOOKED_AT_M: Final = 0.5


def arcline_paths(line: FloatArray) -> list[dict[str, Any]]:
    """The paths of a line ``(N, 2)`` in right-handed axes (m); none of a line without length.

    Each begins where the one before ends, and is the longest circle through the first, the middle
    and the last of its points with the others within 2 cm.
    """
    if float(np.hypot(*np.diff(line, axis=0).T).sum()) < SHORTEST_M:
        return []
    line = with_steps(line, _LOOKED_AT_M)  # an arc through the ends of a chord may leave it
    paths, first = [], 0
    while first < len(line) - 1:
        last = _farthest(line, first)
        paths.append(_path(line[first : last + 1]))
        first = last
    return paths


def _farthest(line: FloatArray, first: int) -> int:
    """The last point of the longest arc from a point, looked for in doubling steps, then halving.

    What is beyond a bad end is not looked at.
    """
    good, step = first + 1, 1
    while good + step < len(line) and _fits(line[first : good + step + 1]):
        good, step = good + step, 2 * step
    while step:
        if good + step < len(line) and _fits(line[first : good + step + 1]):
            good += step
        step //= 2
    return good


def _fits(points: FloatArray) -> bool:
    start, curvature, turn = _arc(points)
    if abs(turn) > math.pi:
        return False
    centred = points - points[0]
    along = np.array([math.cos(start), math.sin(start)])
    ahead, left = centred @ along, along[0] * centred[:, 1] - along[1] * centred[:, 0]
    if curvature:
        away = np.hypot(ahead, left - 1.0 / curvature) - 1.0 / abs(curvature)
    else:
        away = left
    return bool(np.abs(away).max() <= TOLERANCE_M)


def _arc(points: FloatArray) -> tuple[float, float, float]:
    """Heading at the first point (rad), signed curvature (1/m) and turn (rad) to the last one."""
    a, b, c = points[0], points[len(points) // 2], points[-1]
    chord = float(np.hypot(*(c - a)))
    heading = math.atan2(*(c - a)[::-1])
    sides = chord * float(np.hypot(*(b - a)) * np.hypot(*(c - b)))
    cross = float((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0])
    curvature = 2.0 * cross / sides if sides else 0.0
    if abs(curvature) < _FLATTEST_PER_M:
        return heading, 0.0, 0.0
    # The middle point beyond the centre makes the longer of the two arcs.
    half = math.asin(min(1.0, abs(curvature) * chord / 2.0))
    if float((a - b) @ (c - b)) > 0.0:
        half = math.pi - half
    turn = math.copysign(2.0 * half, curvature)
    return heading - turn / 2.0, curvature, turn


def _path(points: FloatArray) -> dict[str, Any]:
    start, curvature, turn = _arc(points)
    if curvature:
        shape, radius = ("LSL" if curvature > 0.0 else "RSR"), 1.0 / abs(curvature)
        lengths = [abs(turn) * radius, 0.0, 0.0]
    else:
        shape, radius = "LSL", _STRAIGHT_RADIUS_M
        lengths = [0.0, float(np.hypot(*(points[-1] - points[0]))), 0.0]
    return {
        "start_pose": _pose(points[0], start),
        "end_pose": _pose(points[-1], start + turn),
        "shape": shape,
        "radius": round(radius, _DIGITS),
        "segment_length": [round(length, _DIGITS) for length in lengths],
    }


def _pose(place: FloatArray, heading: float) -> list[float]:
    return [round(float(value), _DIGITS) for value in (*place, wrap_angle(heading))]
