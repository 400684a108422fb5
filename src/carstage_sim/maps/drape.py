"""Heights: of a level's road surface from its lanes, of the land between from the road edges."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage_sim.maps.strips import Strip

_FLAT_M = 1e-3
_BEND_M = 0.012
"""How far the surface may leave a road's profile between two cuts."""
_REACH_M = 0.05
_SOLVER_STEPS = 4000
_SOLVER_ERROR_M = 1e-4


class Drape:
    """The height of a level's lanes at places on and beside them.

    Args:
        lanes: strips of one level, at least one.
    """

    def __init__(self, lanes: list[Strip]) -> None:
        z = np.concatenate([lane.z_m for lane in lanes])
        self._constant_m = float(z.min()) if np.ptp(z) < _FLAT_M else None
        if self._constant_m is not None and abs(self._constant_m) < _FLAT_M:
            self._constant_m = 0.0
        begin = np.concatenate([lane.center[:-1] for lane in lanes])
        end = np.concatenate([lane.center[1:] for lane in lanes])
        self._z0 = np.concatenate([lane.z_m[:-1] for lane in lanes])
        self._z1 = np.concatenate([lane.z_m[1:] for lane in lanes])
        self._begin, self._step = begin, end - begin
        lines = shapely.linestrings(np.stack([begin, end], axis=1))
        self._tree = shapely.STRtree(np.asarray(lines))

    @property
    def is_flat(self) -> bool:
        """Whether all lanes lie at one height."""
        return self._constant_m is not None

    def height(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """``(P,)`` height (m) at ``(P, 2)`` points: that of the nearest lane's middle."""
        if self._constant_m is not None:
            return np.full(len(points), self._constant_m)
        nearest = self._tree.nearest(shapely.points(points))
        step = self._step[nearest]
        run = ((points - self._begin[nearest]) * step).sum(axis=1)
        share = np.clip(run / np.maximum((step**2).sum(axis=1), 1e-12), 0.0, 1.0)
        z: NDArray[np.float64] = self._z0[nearest] * (1.0 - share) + self._z1[nearest] * share
        return z


def profile_cuts(lanes: list[Strip]) -> list[BaseGeometry]:
    """Lines across the roads, at which a surface must have corners to follow their profiles."""
    edges: dict[int, list[NDArray[np.float64]]] = {}
    wanted: set[int] = set()
    heading: dict[int, float] = {}
    for lane in lanes:
        if np.ptp(lane.z_m) < _FLAT_M:
            continue
        # Ends too: there, neighbouring roads may bend in their profile.
        wanted.update(int(lane.station[i]) for i in _corners(lane.along_m, lane.z_m))
        for line in (lane.offset(-1.0), lane.offset(1.0)):
            for number, point in zip(lane.station.tolist(), line, strict=True):
                edges.setdefault(number, []).append(point)
        heading.update(zip(lane.station.tolist(), np.radians(lane.yaw_deg).tolist(), strict=True))
    cuts: list[BaseGeometry] = []
    for number in sorted(wanted):
        points = np.array(edges[number])
        across = np.array([-np.sin(heading[number]), np.cos(heading[number])])
        reach = points @ across
        a, b = points[reach.argmin()], points[reach.argmax()]
        if np.linalg.norm(b - a) > _REACH_M:
            cuts.append(shapely.LineString([a - _REACH_M * across, b + _REACH_M * across]))
    return cuts


def _corners(along_m: NDArray[np.float64], z_m: NDArray[np.float64]) -> list[int]:
    """Indices that a profile needs (Ramer-Douglas-Peucker), ends included."""
    kept, todo = {0, len(z_m) - 1}, [(0, len(z_m) - 1)]
    while todo:
        first, last = todo.pop()
        if last - first < 2:
            continue
        run = along_m[first : last + 1]
        chord = np.interp(run, run[[0, -1]], z_m[[first, last]])
        error = np.abs(z_m[first : last + 1] - chord)
        worst = int(error.argmax())
        if error[worst] > _BEND_M:
            kept.add(first + worst)
            todo += [(first, first + worst), (first + worst, last)]
    return sorted(kept)


def spread_heights(
    points: NDArray[np.float64],
    triangles: NDArray[np.int64],
    known: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Smooth heights between known ones: each free point lies at the mean of its neighbours.

    The mean is weighted by the edges' lengths (a graph's harmonic extension), so nothing overshoots
    the known heights. Solved by conjugate gradients.

    Args:
        points: ``(P, 2)`` m.
        triangles: ``(T, 3)`` the mesh whose edges connect the points.
        known: ``(P,)`` heights in m, NaN where they are to be found.

    Returns:
        ``(P,)`` heights; points that no edge connects to a known one get the mean.
    """
    free = np.isnan(known)
    fixed = known[~free]
    start = 0.0
    if len(fixed):
        start = float(fixed[0]) if np.ptp(fixed) < _FLAT_M else float(fixed.mean())
    z: NDArray[np.float64] = np.where(free, start, known)
    if not free.any() or not len(fixed) or np.ptp(fixed) < _FLAT_M:
        return z
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    a, b = edges[:, 0], edges[:, 1]
    weight = 1.0 / np.maximum(np.linalg.norm(points[a] - points[b], axis=1), 0.05)
    count = len(points)
    degree = np.zeros(count)
    for ends in (a, b):
        degree += np.bincount(ends, weight, count)
    scale: NDArray[np.float64] = np.where(free, 1.0 / np.maximum(degree, 1e-12), 0.0)

    def residual(value: NDArray[np.float64]) -> NDArray[np.float64]:
        flow = weight * (value[b] - value[a])
        total = np.zeros(count)
        total += np.bincount(a, flow, count)
        total -= np.bincount(b, flow, count)
        return np.where(free, total, 0.0)

    r = residual(z)
    p = scale * r
    rho = float(r @ p)
    for _ in range(_SOLVER_STEPS):
        if np.abs(scale * r).max() < _SOLVER_ERROR_M:
            break
        q = -residual(np.where(free, p, 0.0))
        alpha = rho / float(p @ q)
        z += alpha * p
        r -= alpha * q
        s = scale * r
        rho, before = float(r @ s), rho
        p = s + rho / before * p
    return z
