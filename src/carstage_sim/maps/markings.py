"""Paint on the road: lane lines, stop lines, zebra crossings."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from carstage_sim.maps.signals import GovernedLane, PaintedArrow, SignalPlan
from carstage_sim.maps.strips import WALKED_KINDS, LaneMark, Strip

DASH_M = 3.0
DASH_GAP_M = 6.0
STOP_LINE_WIDTH_M = 0.4
ZEBRA_BAR_M = 0.5
_CROSSWALK_CLEARANCE_M = 0.9
_ARROW_FOOT_M = 14.6
"""Before the end of the lane: behind a crosswalk, the stop line and the first waiting car."""
_STOP_LINE_FROM_EDGE_M = 0.1
_SAME_STOP_M = 2.2
_DOUBLE_SPACING_M = 0.24
_STROKES = {
    "NONE": (),
    "Solid": ("Solid",),
    "Broken": ("Broken",),
    "SolidSolid": ("Solid", "Solid"),
    "SolidBroken": ("Solid", "Broken"),
    "BrokenSolid": ("Broken", "Solid"),
    "BrokenBroken": ("Broken", "Broken"),
    "Curb": (),
}
"""Of each of ``MARK_KINDS``, in LibCarla's order (``LaneMarking.h``): from inside to outside, in
the middle of the road from left to right."""


def lane_lines(
    lanes: list[Strip], crosswalks: tuple[shapely.Polygon, ...]
) -> tuple[BaseGeometry, BaseGeometry]:
    """White and yellow lane lines; they stop short of crosswalks."""
    kept_clear = shapely.union_all(
        [walk.buffer(_CROSSWALK_CLEARANCE_M, join_style="mitre") for walk in crosswalks]
    )
    painted: dict[bool, list[BaseGeometry]] = {False: [], True: []}
    innermost = {(lane.road_id, lane.section_id) for lane in lanes if lane.lane_id == -1}
    for lane in lanes:
        if lane.kind in WALKED_KINDS:
            continue
        # Right-hand traffic: a lane's outer line is at its right edge.
        # The first stroke of a double line is the inner one, so at the left.
        lines = [(run, -_DOUBLE_SPACING_M / 2) for run in _runs(lane.offset(1.0), lane.outer)]
        alone = lane.lane_id == 1 and (lane.road_id, lane.section_id) not in innermost
        if lane.lane_id == -1 or alone:
            # In the middle of the road, it is the one at the left of the road.
            first_m = lane.lane_id * _DOUBLE_SPACING_M / 2
            lines += [(run, first_m) for run in _runs(lane.offset(-1.0), lane.inner)]
        for (points, mark), first_m in lines:
            painted[mark.yellow] += _line(points, mark, first_m, kept_clear)
    return shapely.union_all(painted[False]), shapely.union_all(painted[True])


def _runs(
    points: NDArray[np.float64], marks: Sequence[LaneMark]
) -> Iterator[tuple[NDArray[np.float64], LaneMark]]:
    """The stretches of an edge that have one line each."""
    begin = 0
    for mark, pieces in groupby(marks):
        end = begin + len(list(pieces))
        yield points[begin : end + 1], mark
        begin = end


def _line(
    points: NDArray[np.float64], mark: LaneMark, first_m: float, kept_clear: BaseGeometry
) -> list[BaseGeometry]:
    """The strokes of a line; of two, the first lies ``first_m`` to the right of it."""
    strokes = _STROKES[mark.kind]
    offsets = (first_m, -first_m) if len(strokes) == 2 else (0.0,) * len(strokes)
    result: list[BaseGeometry] = []
    for line in shapely.get_parts(shapely.LineString(points).difference(kept_clear)):
        for stroke, offset in zip(strokes, offsets, strict=True):
            for part in _dashes(line) if stroke == "Broken" else [line]:
                along = shapely.offset_curve(part, offset, join_style="mitre") if offset else part
                result.append(along.buffer(mark.width_m / 2, cap_style="flat"))
    return result


def _dashes(line: shapely.LineString) -> list[BaseGeometry]:
    period = DASH_M + DASH_GAP_M
    starts = np.arange(DASH_GAP_M / 2, line.length - DASH_M, period)
    return [substring(line, s, s + DASH_M) for s in starts]


def stop_lines(stops: Sequence[GovernedLane]) -> BaseGeometry:
    """A bar across every lane that ends at a light or a stop sign, before the stop."""
    bars = []
    taken: list[tuple[float, ...]] = []
    # Ways on from one lane have stops close to each other; the first one counts.
    for lane in sorted(stops, key=lambda lane: (lane.road_id, lane.lane_id)):
        if any(math.dist(lane.line[:2], other) < _SAME_STOP_M for other in taken):
            continue
        taken.append(lane.line[:2])
        yaw = math.radians(lane.line_yaw_deg)
        ahead = np.array([math.cos(yaw), math.sin(yaw)])
        right = np.array([-ahead[1], ahead[0]])
        far = np.array(lane.line[:2])
        near = far - STOP_LINE_WIDTH_M * ahead
        side = (lane.width_m / 2 - _STOP_LINE_FROM_EDGE_M) * right
        bars.append(shapely.Polygon([near - side, near + side, far + side, far - side]))
    return shapely.union_all(bars)


def painted_arrows(arrows: Sequence[PaintedArrow]) -> BaseGeometry:
    """The arrows that the file has: each fills its rectangle."""
    found = []
    for arrow in arrows:
        shapes = [np.array(shape) for shape in _arrow(arrow.ways)]
        low, high = (edge(np.concatenate(shapes), axis=0) for edge in (np.min, np.max))
        scale = np.array([arrow.length_m, arrow.width_m]) / (high - low)
        yaw = math.radians(arrow.yaw_deg)
        # The outlines have left positive, CARLA's y is to the right.
        axes = np.array([[math.cos(yaw), math.sin(yaw)], [math.sin(yaw), -math.cos(yaw)]])
        for shape in shapes:
            corners = ((shape - (low + high) / 2) * scale) @ axes + arrow.location[:2]
            found.append(shapely.Polygon(corners))
    return shapely.union_all(found)


def turn_arrows(lanes: list[Strip], plan: SignalPlan) -> BaseGeometry:
    """Arrows on the lanes of wide approaches: where each lane leads, for files without arrows."""
    driving = [lane for lane in lanes if lane.kind == "driving" and lane.junction_id == -1]
    beside = Counter((lane.road_id, lane.section_id, lane.lane_id > 0) for lane in driving)
    last: dict[tuple[int, int], Strip] = {}
    ending: dict[tuple[int, bool], int] = {}
    for lane in driving:
        side, step = (lane.road_id, lane.lane_id > 0), -1 if lane.lane_id > 0 else 1
        if step * (lane.section_id - ending.setdefault(side, lane.section_id)) >= 0:
            ending[side] = lane.section_id
    for lane in driving:
        if lane.section_id == ending[lane.road_id, lane.lane_id > 0]:
            last[lane.road_id, lane.lane_id] = lane
    # Where all go straight on (ramps that join, roads that are numbered anew), none needs telling.
    turning = {
        (road, lane > 0) for (road, lane), turns in plan.turns.items() if turns - {"straight"}
    }
    arrows = []
    for key, lane in last.items():
        if (lane.road_id, lane.lane_id > 0) not in turning:
            continue
        turns = plan.turns.get(key, frozenset())
        along_m = lane.along_m
        station = along_m[-1] - _ARROW_FOOT_M
        if beside[lane.road_id, lane.section_id, lane.lane_id > 0] < 2 or not turns or station < 2:
            continue
        x, y = (float(np.interp(station, along_m, lane.center[:, k])) for k in range(2))
        yaw = np.radians(np.interp(station, along_m, np.unwrap(lane.yaw_deg, period=360.0)))
        c, s = math.cos(yaw), math.sin(yaw)
        for shape in _arrow(turns):
            # The outlines have left positive, CARLA's y is to the right.
            corners = [(x + f * c + left * s, y + f * s - left * c) for f, left in shape]
            arrows.append(shapely.Polygon(corners))
    return shapely.union_all(arrows)


def _arrow(turns: frozenset[str]) -> list[list[tuple[float, float]]]:
    """Outlines (forward, left) in metres of an arrow with a head for every direction."""
    stem = 2.6 if "straight" in turns else 1.9
    shapes = [[(0.0, -0.08), (stem, -0.08), (stem, 0.08), (0.0, 0.08)]]
    if "straight" in turns:
        shapes.append([(stem, -0.32), (stem + 1.3, 0.0), (stem, 0.32)])
    for side, name in ((1.0, "left"), (-1.0, "right")):
        if name in turns:
            bend = [(1.5, 0.0), (1.9, 0.0), (2.25, 0.42), (2.0, 0.56)]
            head = [(1.85, 0.42), (2.5, 0.38), (2.45, 1.05)]
            shapes += [[(f, side * left) for f, left in part] for part in (bend, head)]
    return shapes


def zebra(crosswalks: tuple[shapely.Polygon, ...], lanes: list[Strip]) -> BaseGeometry:
    """Bars along the direction of travel, as wide as the gaps between them."""
    driving = [lane for lane in lanes if lane.kind == "driving"]
    tree = shapely.STRtree([shapely.LineString(lane.center) for lane in driving])
    bars = []
    for walk in crosswalks:
        nearest = driving[int(tree.nearest(walk.centroid))]
        closest = np.argmin(np.linalg.norm(nearest.center - walk.centroid.coords[0], axis=1))
        yaw = math.radians(nearest.yaw_deg[closest])
        along, across = (math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))
        middle = np.array(walk.centroid.coords[0])
        reach = math.hypot(walk.bounds[2] - walk.bounds[0], walk.bounds[3] - walk.bounds[1])
        for side in np.arange(-reach, reach, 2 * ZEBRA_BAR_M):
            a = middle + side * np.array(across)
            b = a + ZEBRA_BAR_M * np.array(across)
            step = reach * np.array(along)
            bar = shapely.Polygon([a - step, a + step, b + step, b - step])
            bars.append(bar.intersection(walk.buffer(-0.05, join_style="mitre")))
    return shapely.union_all(bars)
