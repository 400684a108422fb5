"""Curves that meet given points and poses smoothly, made of lines and arcs."""

from __future__ import annotations

import math
from itertools import pairwise

from carstage_sim.maps.writer.alignment import Alignment, Piece, Point, Pose2, wrapped

_LEAST_TURN_RAD = 0.12
"""Flatter turns are made of two arcs: a single one would be short or far from the middle."""
_LEAST_TANGENT_M = 1.0


def through(points: tuple[Point, ...], radius_m: float) -> Alignment:
    """Straight legs through ``points`` with rounded corners.

    Raises:
        ValueError: if a leg is too short for the arcs at its ends.
    """
    headings = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(points)]
    pieces: list[Piece] = []
    start = Pose2(*points[0], headings[0])
    for i, target in enumerate(points[1:]):
        leg_m = math.dist(start.point, target)
        is_last = i == len(headings) - 1
        angle = 0.0 if is_last else wrapped(headings[i + 1] - headings[i])
        tangent_m = radius_m * math.tan(abs(angle) / 2)
        if leg_m - tangent_m <= 0:
            raise ValueError(f"leg of {leg_m:.1f} m before {target} is too short for its bend")
        line = Piece(start, leg_m - tangent_m, 0.0)
        pieces.append(line)
        if angle:
            arc = Piece(line.end, radius_m * abs(angle), math.copysign(1 / radius_m, angle))
            pieces.append(arc)
            # Restart from the exact heading, so that rounding does not pile up along the road.
            start = Pose2(arc.end.x, arc.end.y, headings[i + 1])
    return tuple(pieces)


def connect(start: Pose2, end: Pose2) -> Alignment:
    """From one pose to another: a line, a turn with one arc, or two arcs."""
    forward, left = start.local(end.point)
    angle = wrapped(end.heading_rad - start.heading_rad)
    if abs(angle) < 1e-9 and abs(left) < 1e-6 and forward > 0:
        return (Piece(start, forward, 0.0),)
    if abs(angle) > _LEAST_TURN_RAD and min(_tangents(start, end)) > _LEAST_TANGENT_M:
        return turn(start, end)
    return two_arcs(start, end)


def turn(start: Pose2, end: Pose2) -> Alignment:
    """From one pose to another whose lines cross between them: a line, an arc, a line.

    The arc is as wide as fits, so that one of the two lines vanishes.
    """
    before_m, after_m = _tangents(start, end)
    angle = wrapped(end.heading_rad - start.heading_rad)
    tangent_m = min(before_m, after_m)
    radius_m = tangent_m / math.tan(abs(angle) / 2)
    pieces: list[Piece] = []
    if before_m - tangent_m > 1e-6:
        pieces.append(Piece(start, before_m - tangent_m, 0.0))
        start = pieces[-1].end
    pieces.append(Piece(start, radius_m * abs(angle), math.copysign(1 / radius_m, angle)))
    if after_m - tangent_m > 1e-6:
        knee = pieces[-1].end
        pieces.append(Piece(Pose2(knee.x, knee.y, end.heading_rad), after_m - tangent_m, 0.0))
    return tuple(pieces)


def two_arcs(start: Pose2, end: Pose2) -> Alignment:
    """From one pose to another by two arcs with equal tangents that meet smoothly.

    The joint is the one of Bolton, "Biarc curves", Computer-Aided Design 7 (1975), with both
    tangents of one length.
    """
    c0, s0 = math.cos(start.heading_rad), math.sin(start.heading_rad)
    c1, s1 = math.cos(end.heading_rad), math.sin(end.heading_rad)
    vx, vy = end.x - start.x, end.y - start.y
    along = vx * (c0 + c1) + vy * (s0 + s1)
    spread = 2 * (1 - (c0 * c1 + s0 * s1))
    square = vx * vx + vy * vy
    if spread < 1e-9:
        tangent_m = square / (2 * along)
    else:
        tangent_m = (math.sqrt(along * along + spread * square) - along) / spread
    joint = (
        (start.x + end.x + tangent_m * (c0 - c1)) / 2,
        (start.y + end.y + tangent_m * (s0 - s1)) / 2,
    )
    first = _arc_to(start, joint)
    last = _arc_to(end.turned(math.pi), joint)
    middle = last.end.turned(-math.pi)
    return (first, Piece(middle, last.length_m, -last.curvature_per_m or 0.0))


def _arc_to(start: Pose2, point: Point) -> Piece:
    """The arc that leaves along ``start`` and reaches ``point``."""
    forward, left = start.local(point)
    chord_m = math.hypot(forward, left)
    half = math.atan2(left, forward)
    if abs(half) < 1e-9:
        return Piece(start, chord_m, 0.0)
    return Piece(start, chord_m * half / math.sin(half), 2 * math.sin(half) / chord_m)


def _tangents(start: Pose2, end: Pose2) -> tuple[float, float]:
    """Distances from ``start`` ahead and from ``end`` back to where their lines cross."""
    forward, left = start.local(end.point)
    angle = wrapped(end.heading_rad - start.heading_rad)
    after_m = left / math.sin(angle)
    return forward - after_m * math.cos(angle), after_m
