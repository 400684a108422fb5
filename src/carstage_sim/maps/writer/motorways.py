"""A motorway ring: the line between its two carriageways, and where its ramps end."""

from __future__ import annotations

import math
from collections.abc import Mapping

from carstage_sim.maps.writer.alignment import (
    Alignment,
    Piece,
    Point,
    Pose2,
    backward,
    offset,
    pose_at,
    wrapped,
)
from carstage_sim.maps.writer.arms import Arm
from carstage_sim.maps.writer.builder import NetworkBuilder
from carstage_sim.maps.writer.carriageways import Carriageway, Exit
from carstage_sim.maps.writer.plan import Interchange, Motorway
from carstage_sim.maps.writer.ramps import RampEnd, Terminal


def middle(plan: Motorway) -> Alignment:
    """The line between the carriageways, counter-clockwise around the origin."""
    width_m, depth_m = plan.size_m
    radius_m = plan.corner_radius_m
    pose = Pose2(-width_m / 2 + radius_m, -depth_m / 2, 0.0)
    pieces: list[Piece] = []
    for side, leg_m in enumerate((width_m, depth_m, width_m, depth_m), start=1):
        pieces.append(Piece(pose, leg_m - 2 * radius_m, 0.0))
        pieces.append(Piece(pieces[-1].end, radius_m * math.pi / 2, 1 / radius_m))
        end = pieces[-1].end
        pose = Pose2(round(end.x, 9), round(end.y, 9), wrapped(side * math.pi / 2))
    return tuple(pieces)


def ramp_ends(plan: Motorway) -> list[RampEnd]:
    """The ends of all ramps."""
    return [
        _ramp_end(plan, change, outer=outer, arrives=arrives)
        for change in plan.interchanges
        for outer in (True, False)
        for arrives in (True, False)
    ]


def add_motorway(
    builder: NetworkBuilder, plan: Motorway, terminals: Mapping[RampEnd, Terminal]
) -> dict[RampEnd, Arm]:
    """Both carriageways and all ramps; the motorway lies at height 0.

    Args:
        builder: takes all of it.
        plan: the ring.
        terminals: for each of its :func:`ramp_ends`.

    Returns:
        The arms that the ramps are at their crossings.

    Raises:
        ValueError: if an interchange is not on a straight.
    """
    line = middle(plan)
    arms: dict[RampEnd, Arm] = {}
    for outer in (True, False):
        base = offset(line if outer else backward(line), -plan.median_m)
        exits = [
            Exit(
                _station(base, pose_at(line, change.station_m).point),
                change,
                terminals[_ramp_end(plan, change, outer=outer, arrives=True)],
                terminals[_ramp_end(plan, change, outer=outer, arrives=False)],
            )
            for change in plan.interchanges
        ]
        exits.sort(key=lambda place: place.station_m)
        arms |= Carriageway(builder, plan, base).build(exits)
    return arms


def _ramp_end(plan: Motorway, change: Interchange, *, outer: bool, arrives: bool) -> RampEnd:
    """Traffic keeps right, so the outer carriageway runs counter-clockwise."""
    at = pose_at(middle(plan), change.station_m)
    heading = at.heading_rad if outer else at.heading_rad + math.pi
    foot = at.moved(0.0, -change.terminal_m if outer else change.terminal_m)
    # Streets name the same point; adding zero turns a negative zero into a positive one.
    return RampEnd((round(foot.x, 6) + 0.0, round(foot.y, 6) + 0.0), heading, arrives)


def _station(base: Alignment, point: Point) -> float:
    """Station on a carriageway's straights of the place beside a point of the middle."""
    at_m = 0.0
    for piece in base:
        forward, left = piece.start.local(point)
        is_beside = 0.0 <= forward <= piece.length_m and abs(left) < 10.0
        if not piece.curvature_per_m and is_beside:
            return at_m + forward
        at_m += piece.length_m
    raise ValueError(f"the interchange at {point} is not on a straight of the motorway")
