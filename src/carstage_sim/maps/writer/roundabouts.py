"""Roundabouts: a circle of one lane, cut into quarters by small junctions at its arms."""

from __future__ import annotations

import math
from collections.abc import Sequence

from carstage_sim.maps.writer.alignment import Piece, Pose2, snapped, wrapped
from carstage_sim.maps.writer.arms import Arm, Side
from carstage_sim.maps.writer.builder import NetworkBuilder
from carstage_sim.maps.writer.cubic import Cubic
from carstage_sim.maps.writer.curves import connect
from carstage_sim.maps.writer.elevation import level
from carstage_sim.maps.writer.junctions import path
from carstage_sim.maps.writer.network import (
    Lane,
    LaneKind,
    LaneSection,
    Road,
    RoadLink,
    RoadMark,
)
from carstage_sim.maps.writer.plan import Control, Roundabout
from carstage_sim.maps.writer.signposts import add_crosswalk, add_priority_sign, add_speed_sign

_GUTTER_M = 0.5
_GUTTER_LANE = 2
_LIMIT_KMH = 30


def add_roundabout(
    builder: NetworkBuilder,
    plan: Roundabout,
    junction_ids: Sequence[int],
    arms: Sequence[Arm],
    height_m: float,
) -> None:
    """The circle and its junctions, one per arm: traffic in it has the right of way.

    Args:
        builder: takes all of it.
        plan: the circle.
        junction_ids: one per arm, in the arms' order.
        arms: two or more that point at the centre.
        height_m: all of it is level.
    """
    order = sorted(range(len(arms)), key=lambda i: _bearing(plan, arms[i]))
    half = math.radians(plan.half_opening_deg)
    sidewalk_m = min(arm.inbound.sidewalk_m for arm in arms)
    quarters: dict[int, Road] = {}
    for index, following in zip(order, [*order[1:], order[0]], strict=True):
        begin = _bearing(plan, arms[index]) + half
        span = (_bearing(plan, arms[following]) - half - begin) % math.tau
        quarters[index] = builder.add_road(
            _quarter(
                plan,
                builder.next_road_id(),
                begin,
                span,
                sidewalk_m,
                (junction_ids[index], junction_ids[following]),
                height_m,
            )
        )
    for index, before in zip(order, [order[-1], *order[:-1]], strict=True):
        arm, junction_id = arms[index], junction_ids[index]
        source = _circle_arm(plan, quarters[before], "end", sidewalk_m)
        target = _circle_arm(plan, quarters[index], "start", sidewalk_m)
        arc = _arc(plan, _bearing(plan, arm) - half, 2 * half)
        ways = (
            (source, target, (arc,), False),
            (source, arm, connect(source.mouth, snapped(arm.out)), True),
            (arm, target, connect(arm.mouth, target.out), True),
        )
        paths = [
            path(
                builder.next_path_id(),
                junction_id,
                one,
                other,
                alignment,
                height_m,
                lanes=(1, 1, 1),
                along_kerb=along_kerb,
            )
            for one, other, alignment, along_kerb in ways
        ]
        builder.add_junction(junction_id, paths, [])
        add_priority_sign(builder, arm, Control.YIELD)
        add_crosswalk(builder, arm)
        add_speed_sign(builder, arm)


def _bearing(plan: Roundabout, arm: Arm) -> float:
    """Direction of an arm, seen from the centre."""
    return math.atan2(arm.mouth.y - plan.center[1], arm.mouth.x - plan.center[0])


def _arc(plan: Roundabout, begin_rad: float, span_rad: float) -> Piece:
    """A piece of the island's edge, counter-clockwise."""
    radius_m = plan.island_radius_m
    middle = Pose2(*plan.center, begin_rad)
    start = middle.moved(radius_m, 0.0).turned(math.pi / 2)
    heading = wrapped(start.heading_rad)
    return Piece(Pose2(start.x, start.y, heading), radius_m * span_rad, 1 / radius_m)


def _quarter(
    plan: Roundabout,
    road_id: int,
    begin_rad: float,
    span_rad: float,
    sidewalk_m: float,
    junctions: tuple[int, int],
    height_m: float,
) -> Road:
    lanes = (
        Lane(-1, LaneKind.DRIVING, (Cubic(0.0, plan.lane_width_m),), RoadMark("solid")),
        Lane(-2, LaneKind.SHOULDER, (Cubic(0.0, _GUTTER_M),), RoadMark("curb")),
        Lane(-3, LaneKind.SIDEWALK, (Cubic(0.0, sidewalk_m),)),
    )
    return Road(
        road_id=road_id,
        alignment=(_arc(plan, begin_rad, span_rad),),
        heights=level(height_m),
        sections=(LaneSection(0.0, lanes),),
        center_mark=RoadMark("curb"),
        speed_limit_kmh=_LIMIT_KMH,
        junction_id=-1,
        predecessor=RoadLink("junction", junctions[0]),
        successor=RoadLink("junction", junctions[1]),
    )


def _circle_arm(plan: Roundabout, road: Road, contact: str, sidewalk_m: float) -> Arm:
    """The circle before (``end``) or behind (``start``) an arm, as an arm of its junction."""
    side = Side(1, plan.lane_width_m, _GUTTER_M, _GUTTER_LANE, sidewalk_m)
    nothing = Side(0, 0.0, 0.0)
    if contact == "end":
        mouth = road.alignment[-1].end
        return Arm(road.road_id, "end", mouth, side, nothing, _LIMIT_KMH, road.length_m)
    mouth = road.alignment[0].start.turned(math.pi)
    return Arm(road.road_id, "start", mouth, nothing, side, _LIMIT_KMH, road.length_m)
