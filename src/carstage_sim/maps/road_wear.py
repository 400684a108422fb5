"""What years leave on a road: tar poured into seams, repairs, covers of manholes and gullies.

They are faces of the ground like lane lines: what a ray meets there is road. All follow the lanes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from carstage_sim.maps.strips import WALKED_KINDS, Strip

_SHORTEST_M = 12.0
"""Lanes that are shorter stay as they were made."""
_SEAM_EVERY_M = 95.0
_SEAM_M = (7.0, 30.0)
_SEAM_WIDTH_M = (0.05, 0.1)
_CRACK_EVERY_M = 75.0
_REPAIR_EVERY_M = 60.0
_MANHOLE_EVERY_M = 46.0
_GULLY_EVERY_M = 24.0
_RIM_M = 0.045
_MANHOLE_M = 0.31
_GULLY_M = (0.5, 0.36)
_WIDEST_GUTTER_M = 1.2
_STEP_M = 3.0
_WOBBLE_M = 0.06


@dataclass(frozen=True, slots=True)
class RoadWear:
    """Areas of a level's roads.

    Attributes:
        covers: of iron.
        repairs: newer asphalt.
        tar: in seams, and rims of what else is here.
    """

    covers: BaseGeometry
    repairs: BaseGeometry
    tar: BaseGeometry


UNWORN = RoadWear(*[shapely.Polygon()] * 3)


def road_wear(
    lanes: Sequence[Strip], crosswalks: Sequence[shapely.Polygon], rng: np.random.Generator
) -> RoadWear:
    """Draw what lies on the lanes outside junctions; crosswalks are kept free."""
    covers: list[BaseGeometry] = []
    repairs: list[BaseGeometry] = []
    tar: list[BaseGeometry] = []
    streets = {lane.road_id for lane in lanes if lane.kind in WALKED_KINDS}
    for lane in lanes:
        if lane.junction_id != -1 or lane.along_m[-1] < _SHORTEST_M:
            continue
        in_town = lane.road_id in streets
        if lane.kind == "driving":
            tar += _seams(lane, rng)
        if lane.kind == "driving" and in_town:
            tar += _cracks(lane, rng)
            repairs += _repairs(lane, rng)
            covers += _manholes(lane, rng)
        elif in_town and lane.kind == "shoulder" and lane.width_m.max() <= _WIDEST_GUTTER_M:
            covers += _gullies(lane, rng)
    free = shapely.union_all([walk.buffer(0.5) for walk in crosswalks])
    iron, newer = shapely.union_all(covers), shapely.union_all(repairs)
    rims = [newer.buffer(_RIM_M, join_style="mitre")]
    areas = (iron, newer, shapely.union_all([*tar, *rims]))
    return RoadWear(*(area.difference(free) for area in areas))


def _count(lane: Strip, every_m: float, rng: np.random.Generator) -> int:
    return int(rng.poisson(float(lane.along_m[-1]) / every_m))


def _seams(lane: Strip, rng: np.random.Generator) -> list[BaseGeometry]:
    """Tar along the lane, where two courses of asphalt meet or wheels have worn it."""
    found = []
    for _ in range(_count(lane, _SEAM_EVERY_M, rng)):
        line = shapely.LineString(lane.offset(float(rng.choice((-0.9, -0.45, 0.45, 0.9, 0.05)))))
        long = float(rng.uniform(*_SEAM_M))
        begin = float(rng.uniform(0.0, max(line.length - long, 0.1)))
        piece = substring(line, begin, min(begin + long, line.length - 0.5))
        found += _poured(piece, rng)
    return found


def _cracks(lane: Strip, rng: np.random.Generator) -> list[BaseGeometry]:
    """Tar across the lane."""
    found = []
    for _ in range(_count(lane, _CRACK_EVERY_M, rng)):
        place, ahead, right, wide = _at(lane, float(rng.uniform(0.1, 0.9)))
        slant = ahead * float(rng.uniform(-0.8, 0.8))
        reach = 0.5 * wide * float(rng.uniform(0.5, 0.95))
        bend = ahead * float(rng.uniform(-0.3, 0.3))
        line = shapely.LineString(
            [place - reach * right - slant, place + bend, place + reach * right + slant]
        )
        found += _poured(line, rng, line.length / 4)
    return found


def _poured(
    line: BaseGeometry, rng: np.random.Generator, step_m: float = _STEP_M
) -> list[BaseGeometry]:
    """A line of tar that a hand drew; none of what is too short."""
    if line.length < step_m:
        return []
    at = np.linspace(0.0, line.length, int(line.length / step_m) + 1)
    points = np.array([line.interpolate(float(station)).coords[0] for station in at])
    points += rng.normal(scale=_WOBBLE_M, size=points.shape)
    half = 0.5 * float(rng.uniform(*_SEAM_WIDTH_M))
    return [shapely.LineString(points).buffer(half, cap_style="flat", join_style="bevel")]


def _repairs(lane: Strip, rng: np.random.Generator) -> list[BaseGeometry]:
    """Trenches across the lane, holes, and strips along it."""
    found = []
    for _ in range(_count(lane, _REPAIR_EVERY_M, rng)):
        place, ahead, right, wide = _at(lane, float(rng.uniform(0.08, 0.92)))
        kind = rng.random()
        if kind < 0.35:
            size = (float(rng.uniform(0.4, 0.9)), 0.5 * wide * float(rng.uniform(0.8, 0.96)))
        elif kind < 0.75:
            size = (float(rng.uniform(0.5, 1.4)), float(rng.uniform(0.35, 0.8)))
        else:
            size = (float(rng.uniform(2.0, 5.0)), float(rng.uniform(0.25, 0.5)))
        aside = max(0.5 * wide - size[1] - 0.1, 0.0)
        found.append(
            _rectangle(place + right * aside * float(rng.uniform(-1.0, 1.0)), ahead, right, size)
        )
    return found


def _manholes(lane: Strip, rng: np.random.Generator) -> list[BaseGeometry]:
    turn = np.radians(np.arange(0.0, 360.0, 22.5))
    disc = _MANHOLE_M * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    found: list[BaseGeometry] = []
    for _ in range(_count(lane, _MANHOLE_EVERY_M, rng)):
        place, _, right, wide = _at(lane, float(rng.uniform(0.05, 0.95)))
        off = right * wide * float(rng.uniform(-0.25, 0.25))
        found.append(shapely.Polygon(place + off + disc))
    return found


def _gullies(lane: Strip, rng: np.random.Generator) -> list[BaseGeometry]:
    found = []
    length = float(lane.along_m[-1])
    for station in np.arange(float(rng.uniform(4.0, _GULLY_EVERY_M)), length - 2, _GULLY_EVERY_M):
        place, ahead, right, wide = _at(lane, float(station) / length)
        size = (0.5 * _GULLY_M[0], 0.5 * min(_GULLY_M[1], 0.8 * wide))
        found.append(_rectangle(place, ahead, right, size))
    return found


def _at(
    lane: Strip, part: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
    """Middle of the lane at a share of its length, unit vectors along it and right, its width."""
    along_m = lane.along_m
    station = part * along_m[-1]
    place = np.array([np.interp(station, along_m, lane.center[:, k]) for k in range(2)])
    yaw = float(np.interp(station, along_m, np.unwrap(lane.yaw_deg, period=360.0)))
    ahead = np.array([math.cos(math.radians(yaw)), math.sin(math.radians(yaw))])
    wide = float(np.interp(station, along_m, lane.width_m))
    return place, ahead, np.array([-ahead[1], ahead[0]]), wide


def _rectangle(
    place: NDArray[np.float64],
    ahead: NDArray[np.float64],
    right: NDArray[np.float64],
    half: tuple[float, float],
) -> BaseGeometry:
    a, b = ahead * half[0], right * half[1]
    return shapely.Polygon([place - a - b, place + a - b, place + a + b, place - a + b])
