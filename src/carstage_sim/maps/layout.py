"""From a street plan to a road network: junctions, lane-to-lane paths, lights.

Every driving lane that enters a junction has a path out of it and every lane that leaves one has a
path into it, so traffic never meets a dead end. Each approach has its own light phase: no two
approaches of a junction are green together, and turning traffic needs no gap.
"""

from __future__ import annotations

import math
from collections import defaultdict

from carstage_sim.maps.alignment import Alignment, Piece, Pose2, length_m, through, turn
from carstage_sim.maps.network import (
    Arm,
    Connection,
    Contact,
    Junction,
    Lane,
    LaneKind,
    Light,
    Road,
    RoadLink,
    RoadMark,
    RoadNetwork,
    SpeedSign,
)
from carstage_sim.maps.plan import Point, Street, StreetProfile, TownPlan

CROSSWALK_NEAR_M = 0.8
"""Edge of a crosswalk that faces the junction, before the mouth."""
CROSSWALK_FAR_M = 4.3
"""Edge of a crosswalk that faces the traffic, before the mouth."""
STOP_LINE_M = 5.6
"""Near edge of the stop line, before the mouth."""
POLE_FROM_KERB_M = 0.9
SPEED_SIGN_M = 11.0
"""Speed limit signs stand this far behind a junction."""
SIGN_FROM_KERB_M = 0.5
_FIRST_JUNCTION_ID = 1000
_FIRST_SIGN_ID = 20000
_FIRST_CONNECTING_ROAD_ID = 100


def build_network(plan: TownPlan) -> RoadNetwork:
    """The road network of a plan; deterministic, ids ascend in the plan's order."""
    ends: dict[Point, list[tuple[int, Contact]]] = defaultdict(list)
    for index, street in enumerate(plan.streets):
        ends[street.points[0]].append((index, "start"))
        ends[street.points[-1]].append((index, "end"))
    centers = sorted(ends, key=lambda p: (p[1], p[0]))
    junction_ids = {center: _FIRST_JUNCTION_ID + i for i, center in enumerate(centers)}

    setbacks = {center: _setbacks(plan, ends[center]) for center in centers}
    roads = [
        _street_road(plan, index, street, setbacks, junction_ids)
        for index, street in enumerate(plan.streets)
    ]
    junctions = []
    for center in centers:
        arms = tuple(
            _arm(roads[index], contact, plan.streets[index].profile)
            for index, contact in ends[center]
        )
        arms = tuple(sorted(arms, key=lambda a: math.remainder(a.mouth.heading_rad, math.tau)))
        first_road = _FIRST_CONNECTING_ROAD_ID + len(roads) - len(plan.streets)
        paths = _junction_paths(junction_ids[center], arms, first_road, roads)
        roads.extend(road for road, _ in paths)
        lights = tuple(
            _light(junction_ids[center], center, arms, phase, [road for road, _ in paths])
            for phase in range(len(arms))
        )
        connections = tuple(connection for _, connection in paths)
        junctions.append(Junction(junction_ids[center], center, arms, connections, lights))
    by_id = {road.road_id: road for road in roads}
    signs = tuple(
        _speed_sign(number, arm, by_id[arm.road_id])
        for number, arm in enumerate(arm for junction in junctions for arm in junction.arms)
    )
    return RoadNetwork(
        plan.name, plan.latitude_deg, plan.longitude_deg, tuple(roads), tuple(junctions), signs
    )


def _speed_sign(number: int, arm: Arm, road: Road) -> SpeedSign:
    """The limit, posted for the traffic that leaves a junction into an arm."""
    lanes = sorted(arm.lane_id(i, inbound=False) for i in (1, arm.lanes))
    side_m = arm.kerb_m + SIGN_FROM_KERB_M
    post = arm.mouth.moved(-SPEED_SIGN_M, side_m)
    return SpeedSign(
        signal_id=str(_FIRST_SIGN_ID + number),
        road_id=road.road_id,
        s_m=length_m(road.alignment) - SPEED_SIGN_M if arm.contact == "end" else SPEED_SIGN_M,
        t_m=math.copysign(side_m, lanes[0]),
        lanes=(lanes[0], lanes[-1]),
        limit_kmh=road.speed_limit_kmh,
        post=post,
    )


def _leg_heading(street: Street, contact: Contact) -> float:
    """Heading from an end point of a street into the street."""
    a, b = street.points[:2] if contact == "start" else street.points[:-3:-1]
    return math.atan2(b[1] - a[1], b[0] - a[0])


def _setbacks(plan: TownPlan, ends: list[tuple[int, Contact]]) -> dict[tuple[int, Contact], float]:
    """How far from the centre each arm ends: room for the crossing streets and the corners."""
    result = {}
    for index, contact in ends:
        heading = _leg_heading(plan.streets[index], contact)
        crossing_m = max(
            plan.streets[other].profile.kerb_m
            for other, end in ends
            if abs(math.sin(_leg_heading(plan.streets[other], end) - heading)) > 0.5
        )
        result[index, contact] = crossing_m + plan.kerb_radius_m
    return result


def _street_road(
    plan: TownPlan,
    index: int,
    street: Street,
    setbacks: dict[Point, dict[tuple[int, Contact], float]],
    junction_ids: dict[Point, int],
) -> Road:
    points = list(street.points)
    for position, contact in ((0, "start"), (-1, "end")):
        back_m = setbacks[street.points[position]][index, contact]  # type: ignore[index]
        heading = _leg_heading(street, contact)  # type: ignore[arg-type]
        x, y = points[position]
        # Round away the sines of right angles: the plan's legs are axis-parallel.
        points[position] = (
            round(x + back_m * math.cos(heading), 9),
            round(y + back_m * math.sin(heading), 9),
        )
    return Road(
        road_id=index + 1,
        alignment=through(tuple(points), plan.bend_radius_m),
        lanes=_street_lanes(street.profile),
        center_mark=RoadMark("solid solid" if street.profile.lanes > 1 else "solid", "yellow"),
        speed_limit_kmh=street.profile.speed_limit_kmh,
        junction_id=-1,
        predecessor=RoadLink("junction", junction_ids[street.points[0]]),
        successor=RoadLink("junction", junction_ids[street.points[-1]]),
    )


def _street_lanes(profile: StreetProfile) -> tuple[Lane, ...]:
    one_side: list[tuple[LaneKind, float, RoadMark | None]] = []
    for i in range(1, profile.lanes + 1):
        mark = RoadMark("solid")
        if i < profile.lanes:
            mark = RoadMark("broken", lane_change="both")
        one_side.append((LaneKind.DRIVING, profile.lane_width_m, mark))
    one_side.append((LaneKind.SHOULDER, profile.gutter_width_m, RoadMark("curb")))
    one_side.append((LaneKind.SIDEWALK, profile.sidewalk_width_m, None))
    left = [Lane(i, *spec) for i, spec in enumerate(one_side, start=1)]
    right = [Lane(-i, *spec) for i, spec in enumerate(one_side, start=1)]
    return (*reversed(left), *right)


def _arm(road: Road, contact: Contact, profile: StreetProfile) -> Arm:
    if contact == "end":
        mouth = road.alignment[-1].end
    else:
        start = road.alignment[0].start
        mouth = Pose2(start.x, start.y, start.heading_rad + math.pi)
    mouth = Pose2(round(mouth.x, 9), round(mouth.y, 9), _right_angle(mouth.heading_rad))
    return Arm(
        road.road_id,
        contact,
        mouth,
        profile.lanes,
        profile.lane_width_m,
        profile.kerb_m,
        profile.sidewalk_width_m,
    )


def _right_angle(heading_rad: float) -> float:
    return round(math.remainder(heading_rad, math.tau) / (math.pi / 2)) * (math.pi / 2)


def _junction_paths(
    junction_id: int, arms: tuple[Arm, ...], first_road: int, streets: list[Road]
) -> list[tuple[Road, Connection]]:
    """One connecting road per pair of arms; a straight one carries all its lanes."""
    speed = {road.road_id: road.speed_limit_kmh for road in streets}
    paths: list[tuple[Road, Connection]] = []
    for source in arms:
        exits = {_direction(source, target): target for target in arms if target is not source}
        for direction in ("right", "straight", "left"):
            if direction not in exits:
                continue
            target = exits[direction]
            lanes = _path_lanes(source, target, direction, exits)
            road = Road(
                road_id=first_road + len(paths),
                alignment=_path_alignment(source, target, direction),
                lanes=lanes,
                center_mark=None,
                speed_limit_kmh=min(speed[source.road_id], speed[target.road_id]),
                junction_id=junction_id,
                predecessor=RoadLink("road", source.road_id, source.contact),
                successor=RoadLink("road", target.road_id, target.contact),
            )
            links = tuple(
                (lane.predecessor, lane.lane_id) for lane in lanes if lane.predecessor is not None
            )
            paths.append((road, Connection(source.road_id, road.road_id, links)))
    return paths


def _direction(source: Arm, target: Arm) -> str:
    """How traffic turns: by the angle from the heading in to the heading out."""
    angle = math.remainder(target.outward_heading_rad - source.mouth.heading_rad, math.tau)
    return {0: "straight", 1: "left", -1: "right"}[round(angle / (math.pi / 2))]


def _path_alignment(source: Arm, target: Arm, direction: str) -> Alignment:
    out = Pose2(target.mouth.x, target.mouth.y, _right_angle(target.outward_heading_rad))
    if direction == "straight":
        forward, _ = source.mouth.local((out.x, out.y))
        return (Piece(source.mouth, forward, 0.0),)
    if direction == "left":
        return turn(source.mouth, out)
    # Right turns hug the kerb: from outermost lane to outermost lane.
    return turn(
        source.mouth.moved(0.0, -(source.lanes - 1) * source.lane_width_m),
        out.moved(0.0, -(target.lanes - 1) * target.lane_width_m),
    )


def _path_lanes(
    source: Arm, target: Arm, direction: str, exits: dict[str, Arm]
) -> tuple[Lane, ...]:
    """Lanes of a connecting road, all running forward, with the lanes that they join."""
    count = min(source.lanes, target.lanes) if direction == "straight" else 1
    first_in = source.lanes if direction == "right" else 1
    first_out = target.lanes if direction == "right" else 1
    kinds = [(LaneKind.DRIVING, source.lane_width_m)] * count
    # The kerb side of a junction: every right turn, and the flat side of a T.
    if direction == "right" or (direction == "straight" and "right" not in exits):
        kinds.append((LaneKind.SHOULDER, source.kerb_m - source.lanes * source.lane_width_m))
        kinds.append((LaneKind.SIDEWALK, source.sidewalk_width_m))
    return tuple(
        Lane(
            lane_id=-(i + 1),
            kind=kind,
            width_m=width_m,
            predecessor=source.lane_id(first_in + i, inbound=True),
            successor=target.lane_id(first_out + i, inbound=False),
        )
        for i, (kind, width_m) in enumerate(kinds)
    )


def _light(
    junction_id: int, center: Point, arms: tuple[Arm, ...], phase: int, paths: list[Road]
) -> Light:
    """The light of one approach: on the far side, right of the lanes that it governs."""
    arm = arms[phase]
    to_center_m, _ = arm.mouth.local(center)
    opposite = [a for a in arms if a is not arm and _direction(arm, a) == "straight"]
    if opposite:
        across_m = to_center_m + math.dist(center, (opposite[0].mouth.x, opposite[0].mouth.y))
    else:
        crossing = next(a for a in arms if a is not arm)
        across_m = to_center_m + crossing.kerb_m + POLE_FROM_KERB_M
    foot = arm.mouth.moved(across_m, -(arm.kerb_m + POLE_FROM_KERB_M))
    facing = _right_angle(arm.mouth.heading_rad + math.pi)
    host, s_m, t_m = _host(foot, paths)
    signal_id = str(junction_id * 10 + phase)
    return Light(
        signal_id=signal_id,
        controller_id=str(junction_id * 10 + 5 + phase),
        phase=phase,
        arm=arm,
        pole=Pose2(foot.x, foot.y, facing),
        reach_m=POLE_FROM_KERB_M + (arm.kerb_m - arm.lanes * arm.lane_width_m / 2),
        host_road=host.road_id,
        host_s_m=s_m,
        host_t_m=t_m,
        host_heading_rad=host.alignment[0].start.heading_rad,
    )


def _host(foot: Pose2, paths: list[Road]) -> tuple[Road, float, float]:
    """The straight path of the junction beside which a pole stands, with its s and t there."""
    best: tuple[float, Road, float, float] | None = None
    for road in paths:
        if len(road.alignment) > 1 or road.alignment[0].curvature_per_m:
            continue
        s_m, t_m = road.alignment[0].start.local((foot.x, foot.y))
        if -1e-6 <= s_m <= length_m(road.alignment) + 1e-6 and (
            best is None or abs(t_m) < best[0] - 1e-6
        ):
            best = (abs(t_m), road, s_m, t_m)
    if best is None:
        raise ValueError(f"no straight path beside the pole at {foot.x:.1f}, {foot.y:.1f}")
    return best[1], min(max(best[2], 0.0), length_m(best[1].alignment)), best[3]
