"""nuScenes's layers of roads: areas, segments, blocks, lanes, connectors and dividers.

OpenDRIVE's lane sections are cut where lanes begin or end; so are lanes, blocks and segments here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Final

import numpy as np

from carstage.exporters.formats.nuscenes_arcs import arcline_paths
from carstage.exporters.formats.nuscenes_map_shapes import Area, MapShapes, joined
from carstage.geometry import FloatArray
from carstage.vector_map import Lane, Marking, VectorMap
from carstage.vector_map.model import DRIVEN_TYPES

Records = list[dict[str, Any]]

_UNMARKED: Final = "NIL"
_STROKES: Final = {
    "solid": "SINGLE_SOLID",
    "broken": "SINGLE_DASHED",
    "botts dots": "SINGLE_DASHED",
    "solid solid": "DOUBLE_SOLID",
    "broken broken": "DOUBLE_DASHED",
    # nuScenes has no word for these; who sees one as solid is on the safe side.
    "solid broken": "DOUBLE_SOLID",
    "broken solid": "DOUBLE_SOLID",
}


@dataclass(slots=True)
class RoadLayers:
    """What the roads become.

    Attributes:
        records: rows by layer.
        paths, connectivity: by token of a lane or connector.
        block_of: tokens of road blocks by id of their lanes.
        segment_of: tokens of road segments by id of their lanes.
        areas: of driven and parking lanes, by id.
    """

    records: dict[str, Records] = field(default_factory=dict)
    paths: dict[str, Records] = field(default_factory=dict)
    connectivity: dict[str, dict[str, list[str]]] = field(default_factory=dict)
    block_of: dict[str, str] = field(default_factory=dict)
    segment_of: dict[str, str] = field(default_factory=dict)
    areas: dict[str, Area] = field(default_factory=dict)

    def add(self, layer: str, record: dict[str, Any]) -> None:
        """Append a row."""
        self.records.setdefault(layer, []).append(record)


def road_layers(town: VectorMap, lanes: Sequence[Lane], shapes: MapShapes) -> RoadLayers:
    """The layers of roads.

    Args:
        town: whose markings are looked up.
        lanes: those that reach into the canvas.
        shapes: take nodes, lines and polygons.
    """
    found = RoadLayers()
    for lane in lanes:
        if lane.type in DRIVEN_TYPES or lane.type == "parking":
            area = lane_area(lane, shapes)
            if area is not None:
                found.areas[lane.id] = area
    whole = shapes.token("drivable_area")
    polygons = [shapes.add_polygon(area) for area in joined(found.areas.values())]
    if polygons:
        found.add("drivable_area", {"token": whole, "polygon_tokens": polygons})
    for group in _sections(lanes):
        for stretch in _stretches(group):
            driven = [lane for lane in stretch if lane.id in found.areas]
            if not driven:
                continue
            if driven[0].junction_id is None:
                _add_segment(found, shapes, [_strip(stretch, shapes)], driven, whole)
                _add_blocks(found, shapes, stretch)
                _add_dividers(found, shapes, town, stretch)
    for junction in sorted({lane.junction_id for lane in lanes if lane.junction_id is not None}):
        within = [
            lane
            for lane in lanes
            if lane.junction_id == junction and lane.id in found.areas and lane.type in DRIVEN_TYPES
        ]
        parts = joined(found.areas[lane.id] for lane in within)
        _add_segment(found, shapes, parts, within, whole)
    _add_lanes(found, town, lanes, shapes)
    return found


def _along(lane: Lane) -> tuple[FloatArray, FloatArray]:
    """Its left and right boundary as seen along the road's reference line."""
    if lane.s_m[0] <= lane.s_m[-1]:
        return lane.left_boundary, lane.right_boundary
    return lane.right_boundary[::-1], lane.left_boundary[::-1]


def _strip(lanes: Sequence[Lane], shapes: MapShapes) -> Area | None:
    """The area of lanes side by side, from the left to the right along the road."""
    lines = [_along(lanes[0])[0], *(_along(lane)[1] for lane in lanes)]
    inner = lines[1:-1]
    end = [line[-1:] for line in inner]
    begin = [line[:1] for line in reversed(inner)]
    return shapes.area(shapes.flat(np.concatenate([lines[0], *end, lines[-1][::-1], *begin])))


def lane_area(lane: Lane, shapes: MapShapes) -> Area | None:
    """The area of a lane; None: it has none."""
    return shapes.area(shapes.flat(np.concatenate([lane.left_boundary, lane.right_boundary[::-1]])))


def _sections(lanes: Sequence[Lane]) -> Iterator[list[Lane]]:
    """Lanes of each lane section, from the left to the right along the reference line."""
    groups: dict[tuple[int, int], list[Lane]] = {}
    for lane in lanes:
        groups.setdefault((lane.road_id, lane.section), []).append(lane)
    for group in groups.values():
        yield sorted(group, key=lambda lane: -lane.lane)


def _stretches(group: Sequence[Lane]) -> Iterator[list[Lane]]:
    """Driven lanes with none of another kind between them."""
    stretch: list[Lane] = []
    for lane in group:
        if lane.type in DRIVEN_TYPES:
            stretch.append(lane)
        elif stretch:
            yield stretch
            stretch = []
    if stretch:
        yield stretch


def _is_forward(lane: Lane) -> bool:
    return bool(lane.s_m[0] <= lane.s_m[-1])


def _add_segment(
    found: RoadLayers,
    shapes: MapShapes,
    areas: Sequence[Area | None],
    lanes: Sequence[Lane],
    drivable_area: str,
) -> None:
    for area in areas:
        if area is None:
            continue
        polygon = shapes.add_polygon(area)
        name = shapes.token("road_segment", polygon)
        found.add(
            "road_segment",
            {
                "token": name,
                "polygon_token": polygon,
                "is_intersection": lanes[0].junction_id is not None,
                "drivable_area_token": drivable_area,
            },
        )
        for lane in lanes:
            place = found.areas[lane.id].representative_point()
            if len(areas) == 1 or area.contains(place):
                found.segment_of[lane.id] = name


def _add_blocks(found: RoadLayers, shapes: MapShapes, stretch: Sequence[Lane]) -> None:
    """Lanes of one direction side by side."""
    for forward in (True, False):
        block = [lane for lane in stretch if _is_forward(lane) == forward]
        area = _strip(block, shapes) if block else None
        if area is None:
            continue
        name = shapes.token("road_block", block[0].id)
        # Across the block in the direction of travel, from the left to the right.
        ordered = block if forward else block[::-1]
        edges = [
            np.concatenate(
                [ordered[0].left_boundary[[end]], *(one.right_boundary[[end]] for one in ordered)]
            )
            for end in (0, -1)
        ]
        begin, end = (shapes.add_line(shapes.flat(edge)) for edge in edges)
        found.add(
            "road_block",
            {
                "token": name,
                "polygon_token": shapes.add_polygon(area),
                "from_edge_line_token": begin,
                "to_edge_line_token": end,
                "road_segment_token": found.segment_of.get(block[0].id, ""),
            },
        )
        found.block_of.update({lane.id: name for lane in block})


def _add_dividers(
    found: RoadLayers, shapes: MapShapes, town: VectorMap, stretch: Sequence[Lane]
) -> None:
    for left, right in pairwise(stretch):
        line = _along(right)[0]
        name = shapes.token("divider", left.id, right.id)
        record = {"token": name, "line_token": shapes.add_line(shapes.flat(line))}
        if _is_forward(left) != _is_forward(right):
            segment = found.segment_of.get(right.id, "")
            found.add("road_divider", {**record, "road_segment_token": segment})
            continue
        forward = _is_forward(right)
        marks = right.left_markings if forward else right.right_markings
        stations = right.s_m if forward else right.s_m[::-1]
        segments = _segments(town, marks, shapes.nodes(shapes.flat(line)), stations)
        if any(one["segment_type"] != _UNMARKED for one in segments):
            found.add("lane_divider", {**record, "lane_divider_segments": segments})


def _segments(
    town: VectorMap, marks: Sequence[str], nodes: Sequence[str], stations: FloatArray
) -> Records:
    """What is painted from each node of a boundary to the next one; the last one has none."""
    middles = (stations[:-1] + stations[1:]) / 2
    kinds = [
        next(
            (
                _kind(mark)
                for mark in (town.marking_by_id[name] for name in marks)
                if mark.s_m[0] <= s <= mark.s_m[1]
            ),
            _UNMARKED,
        )
        for s in middles.tolist()
    ]
    return [
        {"node_token": node, "segment_type": kind}
        for node, kind in zip(nodes, [*kinds, _UNMARKED], strict=True)
    ]


def _kind(mark: Marking) -> str:
    stroke = _STROKES.get(mark.type)
    if stroke is None:
        return _UNMARKED
    return f"{stroke}_{'YELLOW' if mark.colour == 'yellow' else 'WHITE'}"


def _add_lanes(
    found: RoadLayers, town: VectorMap, lanes: Sequence[Lane], shapes: MapShapes
) -> None:
    """Lanes, the connectors in junctions, their centre lines, and what leads where."""
    names: dict[str, str] = {}
    for lane in lanes:
        paths = arcline_paths(shapes.flat(lane.centre_line))
        if lane.type not in DRIVEN_TYPES or lane.id not in found.areas or not paths:
            continue
        name = names[lane.id] = shapes.token("lane", lane.id)
        polygon = shapes.add_polygon(found.areas[lane.id])
        found.paths[name] = paths
        if lane.junction_id is not None:
            found.add("lane_connector", {"token": name, "polygon_token": polygon})
            continue
        begin, end = (
            shapes.add_line(
                shapes.flat(np.stack([lane.left_boundary[at], lane.right_boundary[at]]))
            )
            for at in (0, -1)
        )
        left, right = (
            _segments(town, marks, shapes.nodes(shapes.flat(line)), lane.s_m)
            for marks, line in (
                (lane.left_markings, lane.left_boundary),
                (lane.right_markings, lane.right_boundary),
            )
        )
        found.add(
            "lane",
            {
                "token": name,
                "polygon_token": polygon,
                "lane_type": "CAR",
                "from_edge_line_token": begin,
                "to_edge_line_token": end,
                "left_lane_divider_segments": left,
                "right_lane_divider_segments": right,
            },
        )
    for lane in lanes:
        if lane.id in names:
            found.connectivity[names[lane.id]] = {
                "incoming": [names[one] for one in lane.predecessors if one in names],
                "outgoing": [names[one] for one in lane.successors if one in names],
            }
