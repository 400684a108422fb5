"""One carriageway of a motorway ring: a row of roads and junctions for each interchange.

With the traffic: a lane opens to the right of the others (junction ``opening``), runs beside them
for deceleration (road), leaves them (``fork``); behind the bridge a ramp joins as a further lane
(``joining``), which runs beside the others for acceleration (road) and merges into the outer one
(``merging``). The reference line is the edge of the median; lane 1 is the inner shoulder.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from carstage_sim.maps.writer.alignment import Alignment, Pose2, cut, length_m, pose_at
from carstage_sim.maps.writer.arms import Arm
from carstage_sim.maps.writer.builder import NetworkBuilder
from carstage_sim.maps.writer.cubic import Cubic, eased
from carstage_sim.maps.writer.curves import connect
from carstage_sim.maps.writer.network import (
    Connection,
    Lane,
    LaneKind,
    LaneSection,
    Road,
    RoadLink,
    RoadMark,
)
from carstage_sim.maps.writer.plan import Interchange, Motorway
from carstage_sim.maps.writer.ramps import RampEnd, Terminal, add_ramp
from carstage_sim.maps.writer.signposts import post_limit

OPENING_M = 80.0
"""Over this length the outer lane splits in two."""
DECELERATION_M = 100.0
FORK_M = 75.0
"""Over this length a ramp leaves the carriageway, or joins it."""
ACCELERATION_M = 150.0
MERGING_M = 90.0
_RAMP_APART_M = 4.6
"""Between a ramp and the outermost lane, where the ramp's own road begins."""
_RAMP_ANGLE_RAD = math.radians(5.0)
_MARK_M = 0.2
_SIGN_AFTER_M = 25.0
_SIGN_ASIDE_M = 0.8
_DASHES = RoadMark("broken", width_m=_MARK_M, lane_change="both")
_EDGE = RoadMark("solid", width_m=_MARK_M)
_EDGE_LEFT = RoadMark("solid", "yellow", _MARK_M)


@dataclass(frozen=True, slots=True)
class Exit:
    """An interchange as one carriageway meets it: a station with the traffic, and two ramps."""

    station_m: float
    change: Interchange
    off: Terminal
    on: Terminal

    @property
    def gore_m(self) -> float:
        """Where the deceleration lane leaves the others."""
        return self.station_m - self.change.ramp_reach_m

    @property
    def nose_m(self) -> float:
        """Where the ramp has become the acceleration lane."""
        return self.station_m + self.change.ramp_reach_m

    @property
    def begin_m(self) -> float:
        """Where the deceleration lane begins to open."""
        return self.gore_m - DECELERATION_M - OPENING_M

    @property
    def end_m(self) -> float:
        """Where the acceleration lane has merged."""
        return self.nose_m + ACCELERATION_M + MERGING_M


@dataclass(frozen=True, slots=True)
class _Nodes:
    """Junction ids of one interchange, in the order of the traffic."""

    opening: int
    fork: int
    joining: int
    merging: int


class Carriageway:
    """Builds one direction of a motorway.

    Args:
        builder: takes the roads and junctions.
        plan: the cross-section.
        base: the closed reference line, with the traffic.
    """

    def __init__(self, builder: NetworkBuilder, plan: Motorway, base: Alignment) -> None:
        self._builder = builder
        self._plan = plan
        self._total_m = length_m(base)
        # Twice around, so that no cut has to wrap.
        self._base = base + base
        self._outer = plan.lanes + 1
        """Number of the outermost lane that goes all around."""

    def build(self, exits: list[Exit]) -> dict[RampEnd, Arm]:
        """The whole ring; gives back the ramps' arms at their crossings.

        Args:
            exits: at least one, by ascending station.
        """
        nodes = [_Nodes(*(self._builder.next_junction_id() for _ in range(4))) for _ in exits]
        plain = [
            self._road(
                exits[i - 1].end_m - (self._total_m if i == 0 else 0.0),
                exits[i].begin_m,
                0,
                (nodes[i - 1].merging, nodes[i].opening),
            )
            for i in range(len(exits))
        ]
        arms: dict[RampEnd, Arm] = {}
        for i, (place, node) in enumerate(zip(exits, nodes, strict=True)):
            arms |= self._exit(place, node, plain[i], plain[(i + 1) % len(exits)])
        return arms

    def _exit(self, place: Exit, node: _Nodes, before: Road, after: Road) -> dict[RampEnd, Arm]:
        outer, extra = self._outer, self._outer + 1
        gore_m, nose_m = place.gore_m, place.nose_m
        slow_m, fast_m = gore_m - DECELERATION_M, nose_m + ACCELERATION_M
        slow = self._road(slow_m, gore_m, 1, (node.opening, node.fork))
        under = self._road(gore_m + FORK_M, nose_m - FORK_M, 0, (node.fork, node.joining))
        fast = self._road(nose_m, fast_m, 1, (node.joining, node.merging))
        limit_kmh = place.change.ramp_limit_kmh
        leaves = self._beside(gore_m + FORK_M).turned(-_RAMP_ANGLE_RAD)
        joins = self._beside(nose_m - FORK_M).turned(_RAMP_ANGLE_RAD)
        off, off_arm = add_ramp(self._builder, place.off, leaves, node.fork, limit_kmh)
        on, on_arm = add_ramp(self._builder, place.on, joins, node.joining, limit_kmh)

        self._builder.add_junction(
            node.opening,
            [
                self._through(node.opening, (place.begin_m, slow_m), before, slow),
                self._branch(
                    node.opening,
                    (before, outer, self._left_edge(place.begin_m, outer)),
                    (slow, extra, self._left_edge(slow_m, extra)),
                ),
            ],
            [],
        )
        self._builder.add_junction(
            node.fork,
            [
                self._through(
                    node.fork, (gore_m, gore_m + FORK_M), slow, under, shoulder=(False, True)
                ),
                self._branch(
                    node.fork, (slow, extra, self._left_edge(gore_m, extra)), (off, 1, leaves)
                ),
            ],
            [],
        )
        self._builder.add_junction(
            node.joining,
            [
                self._through(
                    node.joining, (nose_m - FORK_M, nose_m), under, fast, shoulder=(True, False)
                ),
                self._branch(
                    node.joining, (on, 1, joins), (fast, extra, self._left_edge(nose_m, extra))
                ),
            ],
            [],
        )
        self._builder.add_junction(
            node.merging,
            [
                self._through(node.merging, (fast_m, place.end_m), fast, after),
                self._branch(
                    node.merging,
                    (fast, extra, self._left_edge(fast_m, extra)),
                    (after, outer, self._left_edge(place.end_m, outer)),
                ),
            ],
            [],
        )
        return {place.off.end: off_arm, place.on.end: on_arm}

    def _left_edge(self, s_m: float, lane: int) -> Pose2:
        """The left edge of a lane at a station."""
        left_m = self._plan.inner_shoulder_m + (lane - 2) * self._plan.lane_width_m
        return pose_at(self._base, s_m % self._total_m).moved(0.0, -left_m)

    def _beside(self, s_m: float) -> Pose2:
        """The left edge of a ramp where its own road begins or ends."""
        return self._left_edge(s_m, self._outer + 1).moved(0.0, -_RAMP_APART_M)

    def _cut(self, begin_m: float, end_m: float) -> Alignment:
        whole_m = math.floor(begin_m / self._total_m) * self._total_m
        return cut(self._base, begin_m - whole_m, end_m - whole_m)

    def _lanes(self, extra: int) -> list[tuple[LaneKind, float, RoadMark | None]]:
        """Kind, width and outer line of the lanes right of the median."""
        plan = self._plan
        driving = plan.lanes + extra
        return [
            (LaneKind.SHOULDER, plan.inner_shoulder_m, _EDGE_LEFT),
            *[(LaneKind.DRIVING, plan.lane_width_m, _DASHES)] * (driving - 1),
            (LaneKind.DRIVING, plan.lane_width_m, _EDGE),
            (LaneKind.SHOULDER, plan.hard_shoulder_m, None),
        ]

    def _median(self) -> Lane:
        return Lane(1, LaneKind.MEDIAN, (Cubic(0.0, self._plan.median_m),))

    def _road(self, begin_m: float, end_m: float, extra: int, nodes: tuple[int, int]) -> Road:
        """A road between two junctions, with its limit posted."""
        plan = self._plan
        specs = self._lanes(extra)
        lanes = tuple(
            Lane(-i, kind, (Cubic(0.0, width_m),), mark)
            for i, (kind, width_m, mark) in enumerate(specs, start=1)
        )
        road = self._builder.add_road(
            Road(
                road_id=self._builder.next_road_id(),
                kind="motorway",
                alignment=self._cut(begin_m, end_m),
                sections=(LaneSection(0.0, (self._median(), *lanes)),),
                center_mark=None,
                speed_limit_kmh=plan.speed_limit_kmh,
                junction_id=-1,
                predecessor=RoadLink("junction", nodes[0]),
                successor=RoadLink("junction", nodes[1]),
            )
        )
        side_m = sum(width_m for _, width_m, _ in specs) + _SIGN_ASIDE_M
        driving = (-(plan.lanes + extra) - 1, -2)
        post_limit(
            self._builder, road.road_id, _SIGN_AFTER_M, side_m, driving, plan.speed_limit_kmh
        )
        return road

    def _through(
        self,
        junction_id: int,
        stations_m: tuple[float, float],
        before: Road,
        after: Road,
        *,
        shoulder: tuple[bool, bool] = (False, False),
    ) -> tuple[Road, Connection]:
        """The lanes that go straight on.

        Args:
            junction_id: where.
            stations_m: from, to.
            before, after: what they join.
            shoulder: whether there is a hard shoulder at their right when they enter and leave; in
                between it opens or closes. Elsewhere the lane that branches off carries it.
        """
        *specs, hard = self._lanes(0)
        alignment = self._cut(*stations_m)
        lanes = [
            Lane(-i, kind, (Cubic(0.0, width_m),), mark, -i, -i)
            for i, (kind, width_m, mark) in enumerate(specs, start=1)
        ]
        if any(shoulder):
            first_m, last_m = (hard[1] if there else 0.0 for there in shoulder)
            number = -len(specs) - 1
            enters, leaves = (number if there else None for there in shoulder)
            width = eased(0.0, length_m(alignment), (first_m, last_m))
            lanes.append(Lane(number, hard[0], (width,), None, enters, leaves))
        return self._path(junction_id, alignment, (self._median(), *lanes), before, after)

    def _branch(
        self, junction_id: int, source: tuple[Road, int, Pose2], target: tuple[Road, int, Pose2]
    ) -> tuple[Road, Connection]:
        """One lane with the shoulder at its right, and a ramp's paved edge at its left.

        Args:
            junction_id: where.
            source, target: road, number of the lane and the lane's left edge at either end.
        """
        (before, first, begin), (after, last, end) = source, target
        alignment = connect(begin, end)
        edges_m = _left_edge_m(before), _left_edge_m(after)
        lanes = []
        if any(edges_m):
            width = eased(0.0, length_m(alignment), edges_m)
            lanes.append(Lane(1, LaneKind.SHOULDER, (width,)))
        for i, kind in enumerate((LaneKind.DRIVING, LaneKind.SHOULDER)):
            enters, leaves = -first - i, -last - i
            widths_m = _constant_width(before, enters), _constant_width(after, leaves)
            width = eased(0.0, length_m(alignment), widths_m)
            mark = _EDGE if kind is LaneKind.DRIVING else None
            lanes.append(Lane(-1 - i, kind, (width,), mark, enters, leaves))
        return self._path(junction_id, alignment, tuple(lanes), before, after)

    def _path(
        self,
        junction_id: int,
        alignment: Alignment,
        lanes: tuple[Lane, ...],
        before: Road,
        after: Road,
    ) -> tuple[Road, Connection]:
        road = Road(
            road_id=self._builder.next_path_id(),
            kind="motorway",
            alignment=alignment,
            sections=(LaneSection(0.0, lanes),),
            center_mark=None,
            # Midway between the motorway's limit and a ramp's.
            speed_limit_kmh=10 * round((before.speed_limit_kmh + after.speed_limit_kmh) / 20),
            junction_id=junction_id,
            predecessor=RoadLink("road", before.road_id, "end"),
            successor=RoadLink("road", after.road_id, "start"),
        )
        links = tuple((ln.predecessor, ln.lane_id) for ln in lanes if ln.predecessor is not None)
        return road, Connection(before.road_id, road.road_id, links)


def _left_edge_m(road: Road) -> float:
    """Width of the pavement left of a road's reference line."""
    left = [lane for lane in road.sections[0].lanes if lane.lane_id > 0]
    return sum(lane.width[0].a for lane in left if lane.kind is LaneKind.SHOULDER)


def _constant_width(road: Road, lane_id: int) -> float:
    (width_m,) = (lane.width[0].a for lane in road.sections[0].lanes if lane.lane_id == lane_id)
    return width_m
