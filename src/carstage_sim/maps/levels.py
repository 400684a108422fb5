"""Which level each piece of road lies on: the ground, or a bridge above other roads.

A level's surface is a function of x, y. Level 0 holds everything that crosses above nothing; what
crosses above a piece of level n is on level n + 1 at least, as long as it is above, and a few
metres before and after.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from carstage_sim.maps.strips import Samples

CLEARANCE_M = 2.5
"""Roads that overlap in the plan with less between them are one surface (junctions)."""
_ABUTMENT_M = 6.0
"""How far a bridge goes on beyond what it crosses."""
_MOST_LEVELS = 6


def station_levels(samples: Samples) -> NDArray[np.int64]:
    """Level of the piece of road from each station to the next, by station number."""
    station = np.asarray(samples["station"], dtype=np.int64)
    location = np.asarray(samples["location"], dtype=np.float64)
    count = int(station.max(initial=-1)) + 1
    level: NDArray[np.int64] = np.zeros(count, dtype=np.int64)
    if not len(location) or np.ptp(location[:, 2]) < CLEARANCE_M:
        return level
    number, area, z = _pieces(samples)
    one, two = shapely.STRtree(area).query(area, predicate="intersects")
    above = z[one] - z[two] > CLEARANCE_M
    high, low = number[one[above]], number[two[above]]
    if not len(high):
        return level
    road, s_m = _stations(samples, count)
    for _ in range(_MOST_LEVELS):
        raised = level.copy()
        np.maximum.at(raised, high, level[low] + 1)
        raised = _prolonged(raised, road, s_m)
        if (raised == level).all():
            break
        level = np.minimum(raised, _MOST_LEVELS)
    # Lanes beside or under the same wheels rise together, or the surface would lie there twice.
    together = np.abs(z[one] - z[two]) < 1.0
    beside, bridge = number[one[together]], number[two[together]]
    raised = level.copy()
    np.maximum.at(raised, beside, level[bridge])
    return raised


def _pieces(
    samples: Samples,
) -> tuple[NDArray[np.int64], NDArray[np.object_], NDArray[np.float64]]:
    """Station, plan area and height of all pieces of road between neighbouring stations."""
    station = np.asarray(samples["station"], dtype=np.int64)
    location = np.asarray(samples["location"], dtype=np.float64)
    yaw = np.radians(np.asarray(samples["rotation_deg"], dtype=np.float64)[:, 1])
    half = 0.5 * np.asarray(samples["width_m"], dtype=np.float64)
    normal = np.stack([-np.sin(yaw), np.cos(yaw)], axis=1) * half[:, None]
    edges = np.concatenate([location[:, :2] - normal, location[:, :2] + normal])
    owner = np.concatenate([station, station])
    section = np.stack([samples["road_id"], samples["section_id"]], axis=1)
    _, inverse = np.unique(section, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    count, sections = int(station.max()) + 1, int(inverse.max()) + 1
    ends: NDArray[np.int64] = np.zeros(sections, dtype=np.int64)
    np.maximum.at(ends, inverse, station)
    starts: NDArray[np.int64] = np.full(sections, count, dtype=np.int64)
    np.minimum.at(starts, inverse, station)
    # The last station of a section begins no piece, the first one ends none.
    begins, follows = ~np.isin(owner, ends), ~np.isin(owner, starts)
    points = np.concatenate([edges[begins], edges[follows]])
    piece = np.concatenate([owner[begins], owner[follows] - 1])
    order = np.argsort(piece, kind="stable")
    number, start = np.unique(piece[order], return_index=True)
    index = np.repeat(np.arange(len(number)), np.diff(np.append(start, len(order))))
    hulls = shapely.convex_hull(shapely.multipoints(points[order], indices=index))
    area = np.asarray(hulls)
    rows = np.bincount(station, minlength=count)
    height = np.bincount(station, weights=location[:, 2], minlength=count) / np.maximum(rows, 1)
    return number, area, height[number]


def _stations(samples: Samples, count: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Road and distance along it of every station."""
    road: NDArray[np.int64] = np.full(count, -1, dtype=np.int64)
    s_m: NDArray[np.float64] = np.zeros(count)
    station = np.asarray(samples["station"], dtype=np.int64)
    road[station] = samples["road_id"]
    s_m[station] = samples["s_m"]
    return road, s_m


def _prolonged(
    level: NDArray[np.int64], road: NDArray[np.int64], s_m: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Levels spread along their own road, by the length of an abutment both ways."""
    result = level.copy()
    for number in np.unique(road[level > 0]):
        rows = np.flatnonzero(road == number)
        for value in range(1, int(level[rows].max()) + 1):
            raised = s_m[rows[level[rows] >= value]]
            near = np.abs(s_m[rows][:, None] - raised[None]).min(axis=1) <= _ABUTMENT_M
            result[rows[near]] = np.maximum(result[rows[near]], value)
    return result
