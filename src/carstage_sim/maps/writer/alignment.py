"""Reference lines of roads: straight lines and arcs in a row, as OpenDRIVE's plan view has them."""

from __future__ import annotations

import math
from dataclasses import dataclass

Point = tuple[float, float]


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

    def turned(self, angle_rad: float) -> Pose2:
        """The same place, heading ``angle_rad`` further to the left."""
        return Pose2(self.x, self.y, self.heading_rad + angle_rad)

    def local(self, point: Point) -> Point:
        """Forward and left distance of ``point`` from here."""
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        dx, dy = point[0] - self.x, point[1] - self.y
        return dx * c + dy * s, -dx * s + dy * c

    @property
    def point(self) -> Point:
        """The place without the heading."""
        return self.x, self.y


@dataclass(frozen=True, slots=True)
class Piece:
    """A line (``curvature_per_m`` 0) or an arc (left turns positive) from ``start`` on."""

    start: Pose2
    length_m: float
    curvature_per_m: float

    def at(self, s_m: float) -> Pose2:
        """The pose at a distance from the start.

        By the chord, which keeps all digits where an arc is almost a line; differences of sines
        over the curvature lose them.
        """
        h, k = self.start.heading_rad, self.curvature_per_m
        half = k * s_m / 2.0
        if half == 0.0:
            return self.start.moved(s_m, 0.0)
        chord_m = s_m * math.sin(half) / half
        return Pose2(
            self.start.x + chord_m * math.cos(h + half),
            self.start.y + chord_m * math.sin(h + half),
            h + 2.0 * half,
        )

    @property
    def end(self) -> Pose2:
        """The pose at the end of the piece."""
        return self.at(self.length_m)


Alignment = tuple[Piece, ...]


def length_m(alignment: Alignment) -> float:
    """Length of a whole alignment."""
    return sum(piece.length_m for piece in alignment)


def pose_at(alignment: Alignment, s_m: float) -> Pose2:
    """The pose at a distance along an alignment; beyond its ends the end pieces go on."""
    for piece in alignment[:-1]:
        if s_m <= piece.length_m:
            return piece.at(s_m)
        s_m -= piece.length_m
    return alignment[-1].at(s_m)


def cut(alignment: Alignment, begin_m: float, end_m: float) -> Alignment:
    """The part between two distances; ends closer than a micrometre to a joint fall on it."""
    pieces: list[Piece] = []
    at_m = 0.0
    for piece in alignment:
        low, high = max(begin_m - at_m, 0.0), min(end_m - at_m, piece.length_m)
        if high - low > 1e-6:
            pieces.append(Piece(piece.at(low), high - low, piece.curvature_per_m))
        at_m += piece.length_m
    return tuple(pieces)


def offset(alignment: Alignment, left_m: float) -> Alignment:
    """The parallel line ``left_m`` to the left (negative: to the right)."""
    pieces = []
    for piece in alignment:
        scale = 1.0 - piece.curvature_per_m * left_m
        pieces.append(
            Piece(
                piece.start.moved(0.0, left_m),
                piece.length_m * scale,
                piece.curvature_per_m / scale,
            )
        )
    return tuple(pieces)


def backward(alignment: Alignment) -> Alignment:
    """The same line in the other direction."""
    return tuple(
        Piece(piece.end.turned(math.pi), piece.length_m, -piece.curvature_per_m or 0.0)
        for piece in reversed(alignment)
    )


def project(alignment: Alignment, point: Point) -> tuple[float, float] | None:
    """Station and lateral offset (left positive, m) of a point, nearest first.

    Returns:
        None if the point lies beside no piece.
    """
    best: tuple[float, float] | None = None
    at_m = 0.0
    for piece in alignment:
        found = _project_on_piece(piece, point)
        if found and (best is None or abs(found[1]) < abs(best[1]) - 1e-6):
            best = at_m + min(max(found[0], 0.0), piece.length_m), found[1]
        at_m += piece.length_m
    return best


def _project_on_piece(piece: Piece, point: Point) -> tuple[float, float] | None:
    forward, left = piece.start.local(point)
    k = piece.curvature_per_m
    if k == 0.0:
        s_m, t_m = forward, left
    else:
        # In the start's frame the arc's centre lies at (0, 1 / k).
        away = math.hypot(forward, left - 1 / k)
        side = math.copysign(1.0, k)
        angle = math.atan2(forward, (1 / k - left) * side)
        s_m, t_m = angle / abs(k), side * (1 / abs(k) - away)
    return (s_m, t_m) if -1e-6 <= s_m <= piece.length_m + 1e-6 else None


def wrapped(angle_rad: float) -> float:
    """The angle between -pi and pi."""
    return math.remainder(angle_rad, math.tau)


def snapped(pose: Pose2) -> Pose2:
    """The pose without the noise of sines, so that what meets there meets to the last digit."""
    return Pose2(round(pose.x, 9), round(pose.y, 9), snapped_heading(pose.heading_rad))


def snapped_heading(heading_rad: float) -> float:
    """The heading between -pi and pi; right angles exactly."""
    heading = wrapped(heading_rad)
    quarter = round(heading / (math.pi / 2)) * (math.pi / 2)
    return quarter if abs(heading - quarter) < 1e-9 else heading
