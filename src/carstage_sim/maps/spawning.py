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
_END_M = 0.5 * SPACING_M
"""Room at both ends of a lane too short for the distances from junctions."""
_BESIDE_M = 3.0
"""Between two vehicles side by side in parallel lanes; the widest is 2.9 m wide."""
_PARALLEL_DEG = 5.0

_Place = tuple[float, float, float, float, float]
"""x, y, z (m), pitch and yaw (deg), on the road."""


class _Taken:
    """The places that are taken, by cells of the size of the spacing."""

    def __init__(self) -> None:
        self._cells: dict[tuple[int, int], list[_Place]] = {}

    def add(self, place: _Place) -> None:
        self._cells.setdefault(_cell(place), []).append(place)

    def leaves_room_for(self, place: _Place, *, side_by_side: bool) -> bool:
        """Whether nothing is too close, on the same level."""
        column, row = _cell(place)
        near = (
            other
            for dx in (-1, 0, 1)
            for dy in (-1, 0, 1)
            for other in self._cells.get((column + dx, row + dy), ())
            if math.dist(place[:2], other[:2]) < SPACING_M
            and abs(place[2] - other[2]) < CLEARANCE_M
        )
        return all(side_by_side and _are_side_by_side(place, other) for other in near)


def spawn_points(
    lanes: list[Strip], rng: np.random.Generator, *, on_every_lane: bool = False
) -> NDArray[np.float64]:
    """``(N, 6)`` x, y, z (m), pitch, yaw, roll (deg), in an order that scatters them over the map.

    Users take the first N of the list; in road order they would all land in one street.

    Args:
        lanes: all lanes of the map.
        rng: decides the order.
        on_every_lane: after those, points on each driving lane outside junctions that has none
            so far and is longer than a long vehicle: side by side with those of the lanes beside
            it, and in lanes too short for the distances from junctions. The built-in towns do
            without: recordings in them begin at the points that they have had from the start.
    """
    driving = [lane for lane in lanes if lane.kind == "driving" and lane.junction_id == -1]
    taken = _Taken()
    first: list[_Place] = []
    empty: list[Strip] = []
    for lane in driving:
        places = _take(lane, AFTER_JUNCTION_M, BEFORE_JUNCTION_M, taken, side_by_side=False)
        first += places
        if not places:
            empty.append(lane)
    points = _scattered(first, rng)
    if on_every_lane:
        more: list[_Place] = []
        for lane in empty:
            is_short = lane.along_m[-1] <= AFTER_JUNCTION_M + BEFORE_JUNCTION_M
            ends = (_END_M, _END_M) if is_short else (AFTER_JUNCTION_M, BEFORE_JUNCTION_M)
            more += _take(lane, *ends, taken, side_by_side=True)
        points = np.concatenate([points, _scattered(more, rng)])
    return points[:MOST_POINTS]


def _take(
    lane: Strip, after_m: float, before_m: float, taken: _Taken, *, side_by_side: bool
) -> list[_Place]:
    """The places along a lane that are free, which they are no more then."""
    along_m = lane.along_m
    if along_m[-1] <= after_m + before_m:
        return []
    yaw = np.degrees(np.unwrap(np.radians(lane.yaw_deg)))
    stations = np.arange(after_m, along_m[-1] - before_m, _STEP_M)
    x, y = (np.interp(stations, along_m, lane.center[:, k]) for k in range(2))
    z = np.interp(stations, along_m, lane.z_m)
    # Where a road goes on after its course has ended, samples stand still.
    moves = np.diff(along_m, prepend=-1.0) > 0.0
    slope = np.gradient(lane.z_m[moves], along_m[moves])
    pitch = np.degrees(np.arctan(np.interp(stations, along_m[moves], slope)))
    heading = (np.interp(stations, along_m, yaw) + 180.0) % 360.0 - 180.0
    wide = np.interp(stations, along_m, lane.width_m) >= _NARROWEST_LANE_M
    places: list[_Place] = []
    for i in np.flatnonzero(wide).tolist():
        place = (float(x[i]), float(y[i]), float(z[i]), float(pitch[i]), float(heading[i]))
        if taken.leaves_room_for(place, side_by_side=side_by_side):
            taken.add(place)
            places.append(place)
    return places


def _scattered(places: list[_Place], rng: np.random.Generator) -> NDArray[np.float64]:
    rows = [(x, y, z + HEIGHT_M, pitch, yaw, 0.0) for x, y, z, pitch, yaw in places]
    points = np.array(rows, dtype=np.float64).reshape(-1, 6)
    return points[rng.permutation(len(points))]


def _cell(place: _Place) -> tuple[int, int]:
    return int(place[0] // SPACING_M), int(place[1] // SPACING_M)


def _are_side_by_side(place: _Place, other: _Place) -> bool:
    """Whether vehicles at two places stand in parallel lanes with room between them."""
    turn = abs((place[4] - other[4] + 90.0) % 180.0 - 90.0)
    yaw = math.radians(place[4])
    aside_m = (other[1] - place[1]) * math.cos(yaw) - (other[0] - place[0]) * math.sin(yaw)
    return turn < _PARALLEL_DEG and abs(aside_m) >= _BESIDE_M
