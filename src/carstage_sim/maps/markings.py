"""Paint on the road: lane lines, stop lines, zebra crossings."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from carstage_sim.maps.alignment import turning
from carstage_sim.maps.layout import STOP_LINE_M
from carstage_sim.maps.network import RoadNetwork
from carstage_sim.maps.strips import LaneMark, Strip

DASH_M = 3.0
DASH_GAP_M = 6.0
STOP_LINE_WIDTH_M = 0.4
ZEBRA_BAR_M = 0.5
_CROSSWALK_CLEARANCE_M = 0.9
_ARROW_FOOT_M = STOP_LINE_M + 9.0
_DOUBLE_SPACING_M = 0.24


def lane_lines(
    lanes: list[Strip], crosswalks: tuple[shapely.Polygon, ...]
) -> tuple[BaseGeometry, BaseGeometry]:
    """White and yellow lane lines; they stop short of crosswalks."""
    kept_clear = shapely.union_all(
        [walk.buffer(_CROSSWALK_CLEARANCE_M, join_style="mitre") for walk in crosswalks]
    )
    painted: dict[bool, list[BaseGeometry]] = {False: [], True: []}
    for lane in lanes:
        # Right-hand traffic: a lane's outer line is at its right edge.
        if lane.kind == "driving":
            painted[lane.outer.yellow] += _line(lane.offset(1.0), lane.outer, kept_clear)
        if lane.lane_id == -1:
            painted[lane.inner.yellow] += _line(lane.offset(-1.0), lane.inner, kept_clear)
    return shapely.union_all(painted[False]), shapely.union_all(painted[True])


def _line(
    points: NDArray[np.float64], mark: LaneMark, kept_clear: BaseGeometry
) -> list[BaseGeometry]:
    if mark.kind in ("NONE", "Curb"):
        return []
    offsets = [0.0]
    if mark.kind in ("SolidSolid", "SolidBroken", "BrokenSolid"):
        offsets = [-_DOUBLE_SPACING_M / 2, _DOUBLE_SPACING_M / 2]
    result: list[BaseGeometry] = []
    for line in shapely.get_parts(shapely.LineString(points).difference(kept_clear)):
        for offset in offsets:
            beside = line if offset == 0.0 else line.offset_curve(offset, join_style="mitre")
            parts = _dashes(beside) if mark.kind == "Broken" else [beside]
            result += [part.buffer(mark.width_m / 2, cap_style="flat") for part in parts]
    return result


def _dashes(line: shapely.LineString) -> list[BaseGeometry]:
    period = DASH_M + DASH_GAP_M
    starts = np.arange(DASH_GAP_M / 2, line.length - DASH_M, period)
    return [substring(line, s, s + DASH_M) for s in starts]


def stop_lines(network: RoadNetwork) -> BaseGeometry:
    """A bar across the inbound lanes of every signalised approach."""
    bars = []
    for junction in network.junctions:
        for light in junction.lights:
            arm = light.arm
            corners = [
                arm.mouth.moved(-(STOP_LINE_M - back), -side)
                for back, side in (
                    (0.0, 0.2),
                    (STOP_LINE_WIDTH_M, 0.2),
                    (STOP_LINE_WIDTH_M, arm.lanes * arm.lane_width_m - 0.1),
                    (0.0, arm.lanes * arm.lane_width_m - 0.1),
                )
            ]
            bars.append(shapely.Polygon([(c.x, -c.y) for c in corners]))
    return shapely.union_all(bars)


def turn_arrows(network: RoadNetwork) -> BaseGeometry:
    """Arrows on the lanes of wide approaches: where each lane leads."""
    roads = {road.road_id: road for road in network.roads}
    arrows = []
    for junction in network.junctions:
        turns: dict[tuple[int, int], set[str]] = {}
        for connection in junction.connections:
            for source, _ in connection.lane_links:
                turn = turning(roads[connection.connecting_road].alignment)
                turns.setdefault((connection.incoming_road, source), set()).add(turn)
        for arm in junction.arms:
            if arm.lanes < 2:
                continue
            for index in range(1, arm.lanes + 1):
                lane = turns.get((arm.road_id, arm.lane_id(index, inbound=True)), set())
                foot = arm.mouth.moved(-_ARROW_FOOT_M, -(index - 0.5) * arm.lane_width_m)
                for shape in _arrow(lane):
                    corners = [foot.moved(forward, left) for forward, left in shape]
                    arrows.append(shapely.Polygon([(c.x, -c.y) for c in corners]))
    return shapely.union_all(arrows)


def _arrow(turns: set[str]) -> list[list[tuple[float, float]]]:
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
