"""Ramps: one-way roads between a motorway and the streets that cross it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from carstage_sim.maps.writer.alignment import Alignment, Point, Pose2, length_m
from carstage_sim.maps.writer.arms import Arm, Side, Stub
from carstage_sim.maps.writer.builder import NetworkBuilder
from carstage_sim.maps.writer.cubic import Cubic
from carstage_sim.maps.writer.curves import connect
from carstage_sim.maps.writer.elevation import profile
from carstage_sim.maps.writer.network import (
    Contact,
    Lane,
    LaneKind,
    LaneSection,
    Road,
    RoadLink,
    RoadMark,
)

RAMP_LANE_M = 4.0
_SHOULDER_M = 1.5
_EDGE_M = 1.0
"""Width of the paved edge at the left, beside the reference line."""
_LEVEL_M = 10.0
"""A ramp is level this far from its crossing."""
_MARK_M = 0.2


@dataclass(frozen=True, slots=True)
class RampEnd:
    """Where a ramp meets a street.

    Attributes:
        center: middle of the crossing.
        heading_rad: of the ramp's traffic there.
        arrives: whether it comes from the motorway.
    """

    center: Point
    heading_rad: float
    arrives: bool

    @property
    def stub(self) -> Stub:
        """The ramp as an arm of the crossing."""
        lane = Side(1, RAMP_LANE_M, _SHOULDER_M, 2)
        edge = Side(0, 0.0, _EDGE_M)
        if self.arrives:
            return Stub(self.heading_rad + math.pi, lane, edge)
        return Stub(self.heading_rad, edge, lane)


@dataclass(frozen=True, slots=True)
class Terminal:
    """What a ramp must know of the crossing at its end.

    Attributes:
        end: where it is.
        setback_m: how far from the middle the ramp ends.
        junction_id: of the crossing.
        height_m: of the crossing.
    """

    end: RampEnd
    setback_m: float
    junction_id: int
    height_m: float

    @property
    def mouth(self) -> Pose2:
        """The end of the ramp's reference line, heading with its traffic."""
        back_m = -self.setback_m if self.end.arrives else self.setback_m
        return Pose2(*self.end.center, self.end.heading_rad).moved(back_m, 0.0)


def add_ramp(
    builder: NetworkBuilder, terminal: Terminal, fork: Pose2, fork_id: int, limit_kmh: int
) -> tuple[Road, Arm]:
    """The ramp between a motorway and a crossing; the motorway lies at height 0.

    Args:
        builder: takes the road.
        terminal: the crossing.
        fork: where the ramp's own road begins or ends at the motorway, heading with the traffic.
        fork_id: the junction there.
        limit_kmh: posted limit.

    Returns:
        The road, and the arm that it is at its crossing.
    """
    top_m, end = terminal.height_m, terminal.end
    if end.arrives:
        alignment = connect(fork, terminal.mouth)
        total_m = length_m(alignment)
        knots = [(0.0, 0.0), (total_m - _LEVEL_M, top_m), (total_m, top_m)]
        nodes = fork_id, terminal.junction_id
    else:
        alignment = connect(terminal.mouth, fork)
        knots = [(0.0, top_m), (_LEVEL_M, top_m), (length_m(alignment), 0.0)]
        nodes = terminal.junction_id, fork_id
    road = builder.add_road(_ramp_road(builder, alignment, knots, nodes, limit_kmh))
    contact: Contact = "end" if end.arrives else "start"
    mouth = terminal.mouth if end.arrives else terminal.mouth.turned(math.pi)
    stub = end.stub
    arm = Arm(road.road_id, contact, mouth, stub.inbound, stub.outbound, limit_kmh, road.length_m)
    return road, arm


def _ramp_road(
    builder: NetworkBuilder,
    alignment: Alignment,
    knots: list[tuple[float, float]],
    nodes: tuple[int, int],
    limit_kmh: int,
) -> Road:
    lanes = (
        Lane(1, LaneKind.SHOULDER, (Cubic(0.0, _EDGE_M),)),
        Lane(-1, LaneKind.DRIVING, (Cubic(0.0, RAMP_LANE_M),), RoadMark("solid", width_m=_MARK_M)),
        Lane(-2, LaneKind.SHOULDER, (Cubic(0.0, _SHOULDER_M),)),
    )
    return Road(
        road_id=builder.next_road_id(),
        kind="motorway",
        alignment=alignment,
        heights=profile(knots),
        sections=(LaneSection(0.0, lanes),),
        center_mark=RoadMark("solid", "yellow", _MARK_M),
        speed_limit_kmh=limit_kmh,
        junction_id=-1,
        predecessor=RoadLink("junction", nodes[0]),
        successor=RoadLink("junction", nodes[1]),
    )
