"""Reference lines of roads: straight lines and arcs in a row, as OpenDRIVE's plan view has them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from carstage_sim.maps.plan import Point


@dataclass(frozen=True, slots=True)
class Pose2:
    """A point with a heading (rad, counter-clockwise from x) in OpenDRIVE's frame."""

    x: float
    y: float
    heading_rad: float

    def moved(self, forward_m: float, left_m: float) -> Pose2:
        """The pose that lies ahead and to the left of this one, with the same heading."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return Pose2(
            self.x + forward_m * c - left_m * s,
            self.y + forward_m * s + left_m * c,
            self.heading_rad,
        )

    def local(self, point: Point) -> Point:
        """Forward and left distance of ``point`` from here."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        dx, dy = point[0] - self.x, point[1] - self.y
        return dx * c + dy * s, -dx * s + dy * c


@dataclass(frozen=True, slots=True)
class Piece:
    """A line (``curvature_per_m`` 0) or an arc (left turns positive) from ``start`` on."""

    start: Pose2
    length_m: float
    curvature_per_m: float

    @property
    def end(self) -> Pose2:
        """The pose at the end of the piece."""
        h, k, length = self.start.heading_rad, self.curvature_per_m, self.length_m
        if k == 0.0:
            return self.start.moved(length, 0.0)
        h1 = h + k * length
        return Pose2(
            self.start.x + (math.sin(h1) - math.sin(h)) / k,
            self.start.y - (math.cos(h1) - math.cos(h)) / k,
            h1,
        )


Alignment = tuple[Piece, ...]


def length_m(alignment: Alignment) -> float:
    """Length of a whole alignment."""
    return sum(piece.length_m for piece in alignment)


def through(points: tuple[Point, ...], radius_m: float) -> Alignment:
    """Straight legs through ``points`` with rounded corners.

    Raises:
        ValueError: if a leg is too short for the arcs at its ends.
    """
    headings = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(points)]
    pieces: list[Piece] = []
    start = Pose2(*points[0], headings[0])
    for i, target in enumerate(points[1:]):
        leg_m = math.dist((start.x, start.y), target)
        is_last = i == len(headings) - 1
        turn = 0.0 if is_last else _wrapped(headings[i + 1] - headings[i])
        tangent_m = radius_m * math.tan(abs(turn) / 2)
        if leg_m - tangent_m <= 0:
            raise ValueError(f"leg of {leg_m:.1f} m before {target} is too short for its bend")
        line = Piece(start, leg_m - tangent_m, 0.0)
        pieces.append(line)
        if turn:
            arc = Piece(line.end, radius_m * abs(turn), math.copysign(1 / radius_m, turn))
            pieces.append(arc)
            # Restart from the exact heading, so that rounding does not pile up along the road.
            start = Pose2(arc.end.x, arc.end.y, headings[i + 1])
    return tuple(pieces)


def turn(start: Pose2, end: Pose2) -> Alignment:
    """From one pose to another at a right angle: a line, one arc as wide as fits, a line."""
    forward, left = start.local((end.x, end.y))
    radius_m = min(forward, abs(left))
    sign = math.copysign(1.0, left)
    pieces: list[Piece] = []
    if forward - radius_m > 1e-6:
        pieces.append(Piece(start, forward - radius_m, 0.0))
        start = pieces[-1].end
    pieces.append(Piece(start, radius_m * math.pi / 2, sign / radius_m))
    if abs(left) - radius_m > 1e-6:
        knee = pieces[-1].end
        pieces.append(Piece(Pose2(knee.x, knee.y, end.heading_rad), abs(left) - radius_m, 0.0))
    return tuple(pieces)


def turning(alignment: Alignment) -> str:
    """``left``, ``right`` or ``straight``: by the angle between first and last heading."""
    angle = _wrapped(alignment[-1].end.heading_rad - alignment[0].start.heading_rad)
    if abs(angle) < math.pi / 4:
        return "straight"
    return "left" if angle > 0 else "right"


def _wrapped(angle_rad: float) -> float:
    return math.remainder(angle_rad, 2 * math.pi)
