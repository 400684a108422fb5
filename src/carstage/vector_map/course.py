"""Where a road runs: OpenDRIVE's planView, elevation and cubic polynomials, in its own frame.

Sources: ASAM OpenDRIVE 1.6, sections 7.3 to 7.7 (geometry of the reference line), 8.4 (elevation),
9.3 (lane offset); 1.4 has the same elements. Superelevation, crossfall and lateral shapes (8.4.2,
8.4.3) are left out, as CARLA leaves them out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from carstage.geometry import FloatArray

_PANELS = 1024
"""In which the length of a cubic curve is added up."""
_SHORTEST_CHORD_M = 0.02
_MORE_BEND = 1.3
_TURN_OF_PANEL = 2.0
"""Radians; the quadrature is exact to rounding within."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_FEW_NODES, _FEW_WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True, slots=True, eq=False)
class Cubics:
    """Polynomials ``a + b ds + c ds² + d ds³``, each from its station to the next one's.

    Attributes:
        start: ``(N,)`` ascending stations; ds counts from them.
        factors: ``(N, 4)`` a, b, c, d.
    """

    start: FloatArray
    factors: FloatArray

    @classmethod
    def of(cls, rows: Sequence[tuple[float, float, float, float, float]]) -> Cubics:
        """From ``(s, a, b, c, d)``, in any order; of equal stations the last one counts."""
        table = np.array(rows, np.float64).reshape(-1, 5)
        table = table[np.argsort(table[:, 0], kind="stable")]
        return cls(table[:, 0], table[:, 1:])

    def at(self, s: FloatArray) -> FloatArray:
        """Values ``(N,)`` at stations; 0 without a polynomial."""
        if not len(self.start):
            return np.zeros(len(s))
        index = np.clip(np.searchsorted(self.start, s, side="right") - 1, 0, None)
        ds = s - self.start[index]
        a, b, c, d = self.factors[index].T
        return np.asarray(a + ds * (b + ds * (c + ds * d)))


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """One geometry element of the planView.

    Attributes:
        s_m, x, y, heading, length_m: where it begins, and how long it is.
        shape: ``line``, ``arc``, ``spiral``, ``poly3`` or ``paramPoly3``.
        factors: arc: curvature; spiral: curvature at both ends; poly3: a, b, c, d; paramPoly3: aU
            to dU, aV to dV, and the parameter at the end.
    """

    s_m: float
    x: float
    y: float
    heading: float
    length_m: float
    shape: str
    factors: tuple[float, ...] = ()

    def at(self, ds: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """x, y and heading, each ``(N,)``, at distances from its beginning."""
        if self.shape in ("poly3", "paramPoly3"):
            u, v, turn = self._cubic(ds)
            c, s = math.cos(self.heading), math.sin(self.heading)
            return self.x + c * u - s * v, self.y + s * u + c * v, self.heading + turn
        if self.shape == "spiral":
            return self._spiral(ds)
        curvature = self.factors[0] if self.shape == "arc" else 0.0
        half_turn = curvature * ds / 2
        chord = ds * np.sinc(half_turn / np.pi)  # 2 sin(turn / 2) / curvature, also for a line
        along = self.heading + half_turn
        return (
            self.x + chord * np.cos(along),
            self.y + chord * np.sin(along),
            self.heading + 2 * half_turn,
        )

    def _spiral(self, ds: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """A clothoid: curvature changes evenly; the Fresnel integrals by Gauss's quadrature."""
        begin, end = self.factors
        change = (end - begin) / (2 * self.length_m)
        turn = max(abs(begin), abs(end)) * self.length_m
        panels = max(1, math.ceil(turn / _TURN_OF_PANEL))
        edges = np.arange(panels)[:, None] + (_NODES + 1) / 2  # (panels, nodes), in panels
        share = (edges / panels).ravel()
        weights = np.tile(_WEIGHTS, panels) / (2 * panels)
        place = ds[:, None] * share
        heading = self.heading + place * (begin + change * place)
        return (
            self.x + ds * (np.cos(heading) * weights).sum(axis=1),
            self.y + ds * (np.sin(heading) * weights).sum(axis=1),
            self.heading + ds * (begin + change * ds),
        )

    def _cubic(self, ds: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """u, v and heading in the piece's own frame; stations are lengths along the curve."""
        if self.shape == "poly3":
            along, beside, most = np.array([0.0, 1.0, 0.0, 0.0]), np.array(self.factors), None
        else:
            along, beside = np.array(self.factors[:4]), np.array(self.factors[4:8])
            most = self.factors[8]
        end = self.length_m if most is None else most
        edges = np.linspace(0.0, end, _PANELS + 1)
        middle = edges[:-1, None] + (_FEW_NODES + 1) / 2 * (end / _PANELS)
        speed = np.hypot(_slope(along, middle), _slope(beside, middle))
        lengths = np.concatenate(([0.0], np.cumsum(speed @ _FEW_WEIGHTS * (end / _PANELS / 2))))
        if most is not None and lengths[-1] > 0:  # the piece ends where its parameter does
            lengths *= self.length_m / lengths[-1]
        p = np.interp(ds, lengths, edges)
        turn = np.arctan2(_slope(beside, p), _slope(along, p))
        return _value(along, p), _value(beside, p), turn


def _value(factors: FloatArray, p: FloatArray) -> FloatArray:
    a, b, c, d = factors
    return np.asarray(a + p * (b + p * (c + p * d)))


def _slope(factors: FloatArray, p: FloatArray) -> FloatArray:
    _, b, c, d = factors
    return np.asarray(b + p * (2 * c + p * 3 * d))


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A road's reference line.

    Attributes:
        pieces: ascending by station.
        elevation: height by station.
        offset: of the middle lane from the reference line, to the left.
    """

    pieces: tuple[Piece, ...]
    elevation: Cubics
    offset: Cubics

    @property
    def stations(self) -> FloatArray:
        """Where a formula gives way to the next one."""
        starts = [piece.s_m for piece in self.pieces]
        return np.concatenate([starts, self.elevation.start, self.offset.start])

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """``(N, 3)`` places and ``(N,)`` headings of the reference line at stations."""
        places, heading = np.empty((len(s), 3)), np.empty(len(s))
        starts = np.array([piece.s_m for piece in self.pieces])
        index = np.clip(np.searchsorted(starts, s, side="right") - 1, 0, None)
        for number in np.unique(index).tolist():
            here = index == number
            piece = self.pieces[number]
            places[here, 0], places[here, 1], heading[here] = piece.at(s[here] - piece.s_m)
        places[:, 2] = self.elevation.at(s)
        return places, heading

    def beside(self, s: FloatArray, t: FloatArray) -> FloatArray:
        """Places ``t`` to the left of the reference line: ``(M, N, 3)`` for ``(M, N)``."""
        places, heading = self.at(s)
        across = np.stack([-np.sin(heading), np.cos(heading), np.zeros(len(s))], axis=1)
        return np.asarray(places + t[..., None] * across)


def fine_stations(
    places: Callable[[FloatArray], FloatArray], edges: FloatArray, tolerance_m: float, most: int
) -> FloatArray:
    """Stations between which chords stay within a tolerance of curves.

    Args:
        places: ``(M, N, 3)`` places of M curves at N stations.
        edges: ``(K,)`` ascending; between two, the curves are smooth. They are among the result.
        tolerance_m: how far a chord may be from its curve.
        most: chords between two edges.
    """
    share = np.linspace(0.0, 1.0, 9)
    share[-1] -= 1e-9  # at the end, the next formula holds, which may jump
    looked = edges[:-1, None] + np.diff(edges)[:, None] * share
    seen = places(looked.ravel()).reshape(-1, len(edges) - 1, len(share), 3)
    bend = np.linalg.norm(np.diff(seen, 2, axis=2), axis=3).max(axis=(0, 2), initial=0.0)
    # A chord of a curve with second difference b per step h departs by b / 8 of it, by n parts n²
    # times less. Where curvature changes, the most of it lies between what is looked at.
    parts = np.ceil(np.sqrt(_MORE_BEND * bend / (8 * tolerance_m)) * (len(share) - 1))
    most_parts = np.minimum(np.ceil(np.diff(edges) / _SHORTEST_CHORD_M), most)
    parts = np.nan_to_num(parts, nan=1.0, posinf=most)
    parts = np.maximum(np.minimum(parts, most_parts), 1).astype(int)
    inner = [
        np.linspace(low, high, count, endpoint=False)
        for low, high, count in zip(edges[:-1], edges[1:], parts.tolist(), strict=True)
    ]
    return np.concatenate([*inner, edges[-1:]])
