"""A town's map as 123D has it: one Arrow file, a row per lane, group of lanes, area or line.

Written by Arrow alone; py123d itself is not needed. Source of the layout: py123d 0.7's
``ArrowMapWriter``. Places are east-north-up as in 123D's logs, CARLA's with y turned round.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, Final

import msgpack
import numpy as np
import pyarrow as pa

from carstage.geometry import FloatArray
from carstage.vector_map import Lane, Marking, VectorMap
from carstage.vector_map.model import DRIVEN_TYPES, LIGHT_TYPE, WALKED_TYPES
from carstage.vector_map.wkb import to_wkb

LANE, LANE_GROUP, INTERSECTION, CROSSWALK, WALKWAY, CARPARK = range(6)
GENERIC_DRIVABLE, ROAD_EDGE, ROAD_LINE = 6, 8, 9
"""py123d's ``MapLayer``."""
_SURFACE_STREET, _BIKE_LANE = 2, 3
_DEFAULT_INTERSECTION, _WITH_LIGHTS = 0, 1
_BOUNDARY: Final = 1
_LINES: Final = {
    ("broken", "white"): 4,
    ("broken", "yellow"): 5,
    ("solid solid", "yellow"): 6,
    ("solid solid", "white"): 7,
    ("broken broken", "yellow"): 8,
    ("broken broken", "white"): 9,
    ("solid", "yellow"): 10,
    ("solid", "white"): 11,
    ("broken solid", "white"): 3,
    ("broken solid", "yellow"): 2,
    ("solid broken", "white"): 12,
    ("solid broken", "yellow"): 13,
    ("solid", "blue"): 14,
}
"""py123d's ``RoadLineType`` by type and colour of a marking."""
_UNKNOWN_LINE: Final = 1
_UNPAINTED: Final = ("none", "grass", "curb")
_ENU: Final = np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True, slots=True)
class _Row:
    """An object of the map: its layer and number there, its shape, and what py123d says of it."""

    layer: int
    number: int
    wkb: bytes
    features: Mapping[str, Any]


def map_metadata(dataset: str, location: str, version: str) -> dict[str, Any]:
    """What py123d makes its ``MapMetadata`` of; the map is all logs' of that location."""
    return {
        "dataset": dataset,
        "split": None,
        "log_name": None,
        "location": location,
        "map_has_z": True,
        "map_is_per_log": False,
        "version": version,
    }


def write_map(town: VectorMap, path: Path, metadata: Mapping[str, Any]) -> None:
    """Write a town's file.

    Args:
        town: the map.
        path: of the file; its folder exists.
        metadata: see :func:`map_metadata`.
    """
    rows = [*_roads(town), *_areas(town), *_painted(town.markings)]
    table = pa.table(
        {
            "object_id": pa.array([row.number for row in rows], pa.int64()),
            "map_layer": pa.array([row.layer for row in rows], pa.int8()),
            "features": pa.array([_packed(row.features) for row in rows], pa.binary()),
            "wkb": pa.array([row.wkb for row in rows], pa.binary()),
        }
    ).replace_schema_metadata({b"metadata": msgpack.packb(dict(metadata))})
    with pa.OSFile(str(path), "wb") as sink, pa.ipc.new_file(sink, table.schema) as writer:
        writer.write_table(table)


def _roads(town: VectorMap) -> Iterator[_Row]:
    """Lanes, groups of lanes of one direction, and intersections."""
    lanes = [lane for lane in town.lanes if _lane_type(lane) is not None]
    number = {lane.id: i for i, lane in enumerate(lanes)}
    groups = [_left_to_right(group) for group in _groups(lanes)]
    group_of = {lane.id: i for i, group in enumerate(groups) for lane in group}
    junctions = {one.junction_id: i for i, one in enumerate(town.junctions)}

    def numbers(ids: Sequence[str]) -> list[int]:
        return [number[one] for one in ids if one in number]

    for lane in lanes:
        limit = lane.speed_limits[0].limit_m_s if lane.speed_limits else None
        beside = (lane.left_neighbour, lane.right_neighbour)
        # Only lanes of the same direction are beside one another in 123D.
        left, right = (
            number[one] if one and group_of.get(one) == group_of[lane.id] else None
            for one in beside
        )
        yield _area(LANE, number[lane.id], _outline([lane]), {
            "lane_type": _lane_type(lane), "lane_group_id": group_of[lane.id],
            "left_boundary": lane.left_boundary * _ENU,
            "right_boundary": lane.right_boundary * _ENU,
            "centerline": lane.centre_line * _ENU,
            "left_lane_id": left, "right_lane_id": right,
            "predecessor_ids": numbers(lane.predecessors),
            "successor_ids": numbers(lane.successors), "speed_limit_mps": limit,
        })  # fmt: skip
    for i, group in enumerate(groups):
        before = {group_of[one] for lane in group for one in lane.predecessors if one in group_of}
        after = {group_of[one] for lane in group for one in lane.successors if one in group_of}
        yield _area(LANE_GROUP, i, _outline(group), {
            "lane_ids": [number[lane.id] for lane in group],
            "left_boundary": group[0].left_boundary * _ENU,
            "right_boundary": group[-1].right_boundary * _ENU,
            "intersection_id": junctions.get(group[0].junction_id)
            if group[0].junction_id is not None else None,
            "predecessor_ids": sorted(before), "successor_ids": sorted(after),
        })  # fmt: skip
    yield from _intersections(town, groups)


def _intersections(town: VectorMap, groups: Sequence[Sequence[Lane]]) -> Iterator[_Row]:
    lit = {lane for one in town.signals if one.type == LIGHT_TYPE for lane in one.lanes}
    for i, junction in enumerate(town.junctions):
        if junction.outline is None:
            continue
        inside = [j for j, one in enumerate(groups) if one[0].junction_id == junction.junction_id]
        has_lights = any(lane.id in lit for j in inside for lane in groups[j])
        has_lights |= bool(junction.signal_controllers)
        kind = _WITH_LIGHTS if has_lights else _DEFAULT_INTERSECTION
        features = {"intersection_type": kind, "lane_group_ids": inside}
        yield _area(INTERSECTION, i, junction.outline, features)


def _areas(town: VectorMap) -> Iterator[_Row]:
    """Crosswalks, and lanes that nobody drives along."""
    for i, crosswalk in enumerate(town.crosswalks):
        yield _area(CROSSWALK, i, crosswalk.outline, {})
    for layer, types in (
        (WALKWAY, WALKED_TYPES),
        (CARPARK, ("parking",)),
        (GENERIC_DRIVABLE, ("shoulder", "stop")),
    ):
        for i, lane in enumerate(one for one in town.lanes if one.type in types):
            yield _area(layer, i, _outline([lane]), {})


def _painted(markings: Sequence[Marking]) -> Iterator[_Row]:
    """Painted lines, and kerbs as edges of the road."""
    for i, one in enumerate(m for m in markings if m.type not in _UNPAINTED):
        kind = _LINES.get((one.type, one.colour), _UNKNOWN_LINE)
        yield _Row(ROAD_LINE, i, _line(one.line), {"road_line_type": kind})
    for i, one in enumerate(m for m in markings if m.type == "curb"):
        yield _Row(ROAD_EDGE, i, _line(one.line), {"road_edge_type": _BOUNDARY})


def _lane_type(lane: Lane) -> int | None:
    """py123d's ``LaneType``; None: it is no lane there."""
    if lane.type in DRIVEN_TYPES:
        return _SURFACE_STREET
    return _BIKE_LANE if lane.type == "biking" else None


def _groups(lanes: Sequence[Lane]) -> Iterator[list[Lane]]:
    """Lanes of one road section and direction."""

    def key(lane: Lane) -> tuple[int, int, str]:
        return lane.road_id, lane.section, lane.direction

    for _, group in groupby(sorted(lanes, key=key), key):
        yield list(group)


def _left_to_right(group: Sequence[Lane]) -> list[Lane]:
    """The lanes of a group as those see them who drive there: OpenDRIVE counts up to the left."""
    against = group[0].direction == "backward"
    return sorted(group, key=lambda lane: lane.lane, reverse=not against)


def _outline(lanes: Sequence[Lane]) -> FloatArray:
    """``(N, 3)`` closed, around lanes from left to right, in CARLA's frame."""
    left, right = lanes[0].left_boundary, lanes[-1].right_boundary
    return np.concatenate([left, right[::-1], left[:1]])


def _area(layer: int, number: int, outline: FloatArray, features: Mapping[str, Any]) -> _Row:
    there = outline * _ENU
    return _Row(layer, number, to_wkb("Polygon", there), {**features, "outline": there})


def _line(places: FloatArray) -> bytes:
    return to_wkb("LineString", places * _ENU)


def _packed(features: Mapping[str, Any]) -> bytes:
    return bytes(msgpack.packb(dict(features), default=_array))


def _array(value: Any) -> dict[bytes, Any]:
    """An array as py123d's ``msgpack_decode_with_numpy`` reads it."""
    array = np.ascontiguousarray(value, "<f8")
    return {
        b"__ndarray__": True,
        b"dtype": array.dtype.str,
        b"shape": array.shape,
        b"data": array.tobytes(),
    }
