"""From a street of a plan to a road: lane sections with parking bays, and heights."""

from __future__ import annotations

import math

from carstage_sim.maps.writer.alignment import Alignment, length_m, pose_at, snapped
from carstage_sim.maps.writer.arms import Arm, Stub, street_side
from carstage_sim.maps.writer.cubic import Cubic, eased
from carstage_sim.maps.writer.curves import through
from carstage_sim.maps.writer.elevation import LEVEL, Profile, profile
from carstage_sim.maps.writer.network import (
    Contact,
    Lane,
    LaneKind,
    LaneSection,
    Road,
    RoadLink,
    RoadMark,
)
from carstage_sim.maps.writer.plan import Street, StreetProfile, TownPlan

LEVEL_MOUTH_M = 7.0
"""A street is level this far from a junction, so that crosswalk and stop line lie flat."""
_HEIGHT_STEP_M = 45.0
_BAY_FROM_MOUTH_M = 16.0
"""Parking bays keep clear of crosswalks, stop lines and the view of those who turn."""
_BAY_TAPER_M = 4.0
_LEAST_BAY_M = 24.0


def stub(street: Street, contact: Contact) -> Stub:
    """The arm of a street at one of its ends."""
    side = street_side(street.profile)
    return Stub(_leg_heading(street, contact), side, side)


def street_road(
    plan: TownPlan,
    street: Street,
    road_id: int,
    setbacks_m: tuple[float, float],
    junctions: tuple[int, int],
    heights_m: tuple[float, float],
) -> Road:
    """The road of a street, shortened at both ends by what the crossings take.

    Args:
        plan: for the ground.
        street: what to build.
        road_id: its number.
        setbacks_m: taken from its ends.
        junctions: ids of those at its start and end.
        heights_m: of those.

    Raises:
        ValueError: if the street is too short for its crossings and bends.
    """
    points = list(street.points)
    ends: tuple[tuple[int, Contact], ...] = ((0, "start"), (-1, "end"))
    for (position, contact), back_m in zip(ends, setbacks_m, strict=True):
        heading = _leg_heading(street, contact)
        x, y = points[position]
        # Round away the sines of right angles.
        points[position] = (
            round(x + back_m * math.cos(heading), 9),
            round(y + back_m * math.sin(heading), 9),
        )
    alignment = through(tuple(points), street.bend_radius_m)
    narrow = street.profile.lanes == 1
    return Road(
        road_id=road_id,
        kind=street.profile.kind,
        alignment=alignment,
        heights=_heights(plan, alignment, heights_m),
        sections=_sections(street.profile, length_m(alignment)),
        center_mark=RoadMark("solid" if narrow else "solid solid", "yellow"),
        speed_limit_kmh=street.profile.speed_limit_kmh,
        junction_id=-1,
        predecessor=RoadLink("junction", junctions[0]),
        successor=RoadLink("junction", junctions[1]),
    )


def street_arm(road: Road, street: Street, contact: Contact) -> Arm:
    """The arm of a finished street."""
    if contact == "end":
        mouth = road.alignment[-1].end
    else:
        mouth = road.alignment[0].start.turned(math.pi)
    side = street_side(street.profile)
    return Arm(
        road.road_id, contact, snapped(mouth), side, side, road.speed_limit_kmh, road.length_m
    )


def _leg_heading(street: Street, contact: Contact) -> float:
    """Heading from an end point of a street into the street."""
    a, b = street.points[:2] if contact == "start" else street.points[:-3:-1]
    return math.atan2(b[1] - a[1], b[0] - a[0])


def _heights(plan: TownPlan, alignment: Alignment, ends_m: tuple[float, float]) -> Profile:
    """Along the ground, bent so that both ends have the heights of their junctions."""
    if ends_m == (0.0, 0.0) and not plan.hills:
        return LEVEL
    total_m = length_m(alignment)
    flat_m = min(LEVEL_MOUTH_M, total_m / 5)
    first, last = (plan.ground_m(pose_at(alignment, s_m).point) for s_m in (0.0, total_m))
    knots = [(0.0, ends_m[0]), (flat_m, ends_m[0])]
    count = int((total_m - 2 * flat_m) / _HEIGHT_STEP_M)
    for i in range(1, count):
        s_m = flat_m + (total_m - 2 * flat_m) * i / count
        part = (s_m - flat_m) / (total_m - 2 * flat_m)
        bend_m = (1 - part) * (ends_m[0] - first) + part * (ends_m[1] - last)
        knots.append((s_m, plan.ground_m(pose_at(alignment, s_m).point) + bend_m))
    knots += [(total_m - flat_m, ends_m[1]), (total_m, ends_m[1])]
    return profile(knots)


def _sections(street: StreetProfile, road_m: float) -> tuple[LaneSection, ...]:
    bay_m = road_m - 2 * _BAY_FROM_MOUTH_M
    if not street.parking_width_m or bay_m < _LEAST_BAY_M:
        return (LaneSection(0.0, _both_sides(_plain_lanes(street))),)
    plain = _plain_lanes(street)
    last_plain = len(plain)
    # The bay pushes the gutter and the sidewalk one number outwards.
    outer = {last_plain - 1: last_plain, last_plain: last_plain + 1}
    before: list[_Spec] = [
        (kind, width, mark, None, outer.get(i, i))
        for i, (kind, width, mark, _, _) in enumerate(plain, start=1)
    ]
    after: list[_Spec] = [
        (kind, width, mark, successor, None) for kind, width, mark, _, successor in before
    ]
    return (
        LaneSection(0.0, _both_sides(before)),
        LaneSection(_BAY_FROM_MOUTH_M, _both_sides(_bay_lanes(street, bay_m))),
        LaneSection(road_m - _BAY_FROM_MOUTH_M, _both_sides(after)),
    )


_Spec = tuple[LaneKind, tuple[Cubic, ...], RoadMark | None, int | None, int | None]
"""A lane of either side: kind, width, outer line, numbers of the lanes before and after."""


def _plain_lanes(street: StreetProfile) -> list[_Spec]:
    widths = [(LaneKind.DRIVING, street.lane_width_m)] * street.lanes
    if street.biking_width_m:
        widths.append((LaneKind.BIKING, street.biking_width_m))
    widths.append((LaneKind.SHOULDER, street.gutter_width_m))
    if street.sidewalk_width_m:
        widths.append((LaneKind.SIDEWALK, street.sidewalk_width_m))
    specs: list[_Spec] = []
    for i, (kind, width_m) in enumerate(widths, start=1):
        mark: RoadMark | None = None
        if kind is LaneKind.DRIVING:
            is_inner = i < street.lanes
            mark = RoadMark("broken", lane_change="both") if is_inner else RoadMark("solid")
        elif kind is LaneKind.SHOULDER and street.sidewalk_width_m:
            mark = RoadMark("curb")
        specs.append((kind, (Cubic(0.0, width_m),), mark, None, None))
    return specs


def _bay_lanes(street: StreetProfile, bay_m: float) -> list[_Spec]:
    """The lanes beside which cars park: what the bay takes, the sidewalk gives."""
    plain = _plain_lanes(street)
    bay = _bump(street.parking_width_m, bay_m)
    rest = tuple(Cubic(p.start_m, street.sidewalk_width_m - p.a, -p.b, -p.c, -p.d) for p in bay)
    specs: list[_Spec] = [
        (kind, width, mark, i, i) for i, (kind, width, mark, _, _) in enumerate(plain, 1)
    ]
    gutter, sidewalk = specs[-2], specs[-1]
    kerbless = specs[:-2]
    number = len(kerbless) + 1
    return [
        *kerbless,
        (LaneKind.PARKING, bay, None, None, None),
        (gutter[0], gutter[1], gutter[2], number, number),
        (sidewalk[0], rest, sidewalk[2], number + 1, number + 1),
    ]


def _bump(width_m: float, length: float) -> tuple[Cubic, ...]:
    return (
        eased(0.0, _BAY_TAPER_M, (0.0, width_m)),
        Cubic(_BAY_TAPER_M, width_m),
        eased(length - _BAY_TAPER_M, _BAY_TAPER_M, (width_m, 0.0)),
    )


def _both_sides(specs: list[_Spec]) -> tuple[Lane, ...]:
    def lane(sign: int, number: int, spec: _Spec) -> Lane:
        kind, width, mark, before, after = spec
        return Lane(
            sign * number,
            kind,
            width,
            mark,
            None if before is None else sign * before,
            None if after is None else sign * after,
        )

    left = [lane(1, i, spec) for i, spec in enumerate(specs, start=1)]
    right = [lane(-1, i, spec) for i, spec in enumerate(specs, start=1)]
    return (*reversed(left), *right)
