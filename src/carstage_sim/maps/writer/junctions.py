"""Paths through a junction of several arms.

Every driving lane that enters a junction has a path out of it and every lane that leaves one has a
path into it, so traffic never meets a dead end.
"""

from __future__ import annotations

from collections.abc import Sequence

from carstage_sim.maps.writer.alignment import (
    Alignment,
    Point,
    Pose2,
    length_m,
    snapped,
    snapped_heading,
    wrapped,
)
from carstage_sim.maps.writer.arms import Arm, Side
from carstage_sim.maps.writer.builder import NetworkBuilder
from carstage_sim.maps.writer.cubic import eased
from carstage_sim.maps.writer.curves import connect
from carstage_sim.maps.writer.elevation import level
from carstage_sim.maps.writer.network import (
    Connection,
    Lane,
    LaneKind,
    LaneSection,
    Road,
    RoadLink,
)
from carstage_sim.maps.writer.plan import Control
from carstage_sim.maps.writer.signposts import (
    add_crosswalk,
    add_lights,
    add_priority_sign,
    add_speed_sign,
)

DIRECTIONS = ("right", "straight", "left")


def add_crossing(
    builder: NetworkBuilder,
    junction_id: int,
    center: Point,
    arms: Sequence[Arm],
    control: Control,
    height_m: float,
    *,
    turn_limit_kmh: int | None = None,
) -> None:
    """A junction with its paths, crosswalks, lights or signs.

    Args:
        builder: takes all of it.
        junction_id: its number.
        center: where the arms point.
        arms: two or more.
        control: who waits.
        height_m: the junction is level.
        turn_limit_kmh: on paths that turn.

    Raises:
        ValueError: if two arms lie in one direction, or a lane would lead nowhere.
    """
    order = sorted(arms, key=lambda arm: wrapped(arm.mouth.heading_rad))
    paths = crossing_paths(builder, junction_id, order, height_m, turn_limit_kmh)
    _require_ways(junction_id, order, [connection for _, connection in paths], paths)
    lights = []
    if control is Control.SIGNALS:
        lights = add_lights(builder, junction_id, center, order, [road for road, _ in paths])
    else:
        for arm in _minor(order):
            add_priority_sign(builder, arm, control)
    builder.add_junction(junction_id, paths, lights)
    for arm in order:
        if arm.inbound.sidewalk_m and arm.outbound.sidewalk_m:
            add_crosswalk(builder, arm)
        if arm.outbound.lanes:
            add_speed_sign(builder, arm)


def crossing_paths(
    builder: NetworkBuilder,
    junction_id: int,
    arms: Sequence[Arm],
    height_m: float,
    turn_limit_kmh: int | None,
) -> list[tuple[Road, Connection]]:
    """One connecting road per pair of arms; a straight one carries all its lanes."""
    paths: list[tuple[Road, Connection]] = []
    for source in arms:
        if not source.inbound.lanes:
            continue
        others = {source.direction_to(arm): arm for arm in arms if arm is not source}
        if len(others) != len(arms) - 1:
            raise ValueError(f"junction {junction_id}: two arms lie in one direction")
        exits = {way: arm for way, arm in others.items() if arm.outbound.lanes}
        for way in DIRECTIONS:
            if way not in exits:
                continue
            target = exits[way]
            fed = any(
                arm.inbound.lanes and arm.direction_to(target) == "right"
                for arm in arms
                if arm not in (source, target)
            )
            first_in, first_out, count = _lane_match(
                source, target, way, right_leaves="right" in exits, right_arrives=fed
            )
            # The kerb side of a junction: every right turn, and the flat side of a T.
            along_kerb = way == "right" or (way == "straight" and "right" not in others)
            paths.append(
                path(
                    builder.next_path_id(),
                    junction_id,
                    source,
                    target,
                    _path_alignment(source, target, first_in, first_out),
                    height_m,
                    lanes=(first_in, first_out, count),
                    along_kerb=along_kerb,
                    limit_kmh=None if way == "straight" else turn_limit_kmh,
                )
            )
    return paths


def path(
    road_id: int,
    junction_id: int,
    source: Arm,
    target: Arm,
    alignment: Alignment,
    height_m: float,
    *,
    lanes: tuple[int, int, int],
    along_kerb: bool,
    limit_kmh: int | None = None,
) -> tuple[Road, Connection]:
    """A connecting road with all its lanes running forward.

    Args:
        road_id, junction_id: numbers.
        source, target: the arms that it joins.
        alignment: along the left edge of its first lane.
        height_m: it is level.
        lanes: number of its first lane in the source and in the target, and how many it has.
        along_kerb: whether gutter and sidewalk go with it.
        limit_kmh: where the slower of the two roads is too fast.
    """
    first_in, first_out, count = lanes
    size_m = length_m(alignment)
    inner, outer = source.inbound, target.outbound
    specs = [
        (LaneKind.DRIVING, (inner.lane_width_m, outer.lane_width_m), first_in + i, first_out + i)
        for i in range(count)
    ]
    if along_kerb and inner.gutter_lane and outer.gutter_lane:
        specs += _kerb_lanes(inner, outer)
    made = tuple(
        Lane(
            lane_id=-(i + 1),
            kind=kind,
            width=(eased(0.0, size_m, widths_m),),
            predecessor=source.lane_id(before, inbound=True) if before else None,
            successor=target.lane_id(after, inbound=False) if after else None,
        )
        for i, (kind, widths_m, before, after) in enumerate(specs)
    )
    limits_kmh = source.speed_limit_kmh, target.speed_limit_kmh, limit_kmh
    road = Road(
        road_id=road_id,
        alignment=alignment,
        heights=level(height_m),
        sections=(LaneSection(0.0, made),),
        center_mark=None,
        speed_limit_kmh=min(limit for limit in limits_kmh if limit is not None),
        junction_id=junction_id,
        predecessor=RoadLink("road", source.road_id, source.contact),
        successor=RoadLink("road", target.road_id, target.contact),
    )
    links = tuple((lane.predecessor, lane.lane_id) for lane in made if lane.predecessor is not None)
    return road, Connection(source.road_id, road_id, links)


def _kerb_lanes(inner: Side, outer: Side) -> list[tuple[LaneKind, tuple[float, float], int, int]]:
    """What lies right of the driving lanes: kind, widths, numbers before and after (0: none).

    A bicycle lane that does not go on becomes part of the gutter.
    """
    result = []
    rest_m = inner.biking_m, outer.biking_m
    if all(rest_m):
        numbers = inner.gutter_lane - 1, outer.gutter_lane - 1
        result.append((LaneKind.BIKING, rest_m, *numbers))
        rest_m = 0.0, 0.0
    widths_m = rest_m[0] + inner.gutter_m, rest_m[1] + outer.gutter_m
    result.append((LaneKind.SHOULDER, widths_m, inner.gutter_lane, outer.gutter_lane))
    if inner.sidewalk_m or outer.sidewalk_m:
        numbers = (
            inner.gutter_lane + 1 if inner.sidewalk_m else 0,
            outer.gutter_lane + 1 if outer.sidewalk_m else 0,
        )
        result.append((LaneKind.SIDEWALK, (inner.sidewalk_m, outer.sidewalk_m), *numbers))
    return result


def _lane_match(
    source: Arm, target: Arm, way: str, *, right_leaves: bool, right_arrives: bool
) -> tuple[int, int, int]:
    """First lane in the source, first lane in the target, number of lanes of a path.

    Right turns use the outermost lanes, left turns the innermost ones. Where the source has no
    right turn, or nobody turns right into the target, the straight path takes the outer lanes.
    """
    lanes_in, lanes_out = source.inbound.lanes, target.outbound.lanes
    if way == "left":
        return 1, 1, 1
    if way == "right":
        return lanes_in, lanes_out, 1
    count = min(lanes_in, lanes_out)
    first_in = 1 if right_leaves else lanes_in - count + 1
    first_out = 1 if right_arrives else lanes_out - count + 1
    return first_in, first_out, count


def _path_alignment(source: Arm, target: Arm, first_in: int, first_out: int) -> Alignment:
    """Between the left edges of two lanes."""
    begin = source.mouth.moved(0.0, -(first_in - 1) * source.inbound.lane_width_m)
    end = snapped(target.out).moved(0.0, -(first_out - 1) * target.outbound.lane_width_m)
    return connect(begin, Pose2(end.x, end.y, snapped_heading(end.heading_rad)))


def _minor(arms: Sequence[Arm]) -> list[Arm]:
    """The approaches that wait: the stem of a T, ramps, or all but the widest street."""
    entering = [arm for arm in arms if arm.inbound.lanes]
    ramps = [arm for arm in entering if not arm.outbound.lanes]
    if ramps:
        return ramps
    stems = [
        arm
        for arm in entering
        if not any(arm.direction_to(a) == "straight" for a in arms if a is not arm)
    ]
    if stems:
        return stems
    widest = max(arm.inbound.lanes for arm in entering)
    narrow = [arm for arm in entering if arm.inbound.lanes < widest]
    return narrow or entering


def _require_ways(
    junction_id: int,
    arms: Sequence[Arm],
    connections: list[Connection],
    paths: list[tuple[Road, Connection]],
) -> None:
    entered = {(c.incoming_road, lane) for c in connections for lane, _ in c.lane_links}
    left = {
        (road.successor.element_id, lane.successor)
        for road, _ in paths
        for lane in road.sections[-1].lanes
    }
    for arm in arms:
        for inbound, used in ((True, entered), (False, left)):
            side = arm.inbound if inbound else arm.outbound
            for i in range(1, side.lanes + 1):
                if (arm.road_id, arm.lane_id(i, inbound=inbound)) not in used:
                    raise ValueError(
                        f"junction {junction_id}: lane {i} of road {arm.road_id} leads nowhere"
                    )
