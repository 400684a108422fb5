"""nuScenes's map expansion, version 1.3, from a vector map: what ``NuScenesMap`` loads and draws.

Layers and their fields are those that ``map_expansion/map_api.py`` of the devkit reads, and its
tutorial names.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.exporters.formats.nuscenes_map_roads import (
    Records,
    RoadLayers,
    lane_area,
    road_layers,
)
from carstage.exporters.formats.nuscenes_map_shapes import MapShapes, joined
from carstage.exporters.road_cells import CELL_M
from carstage.geometry import FloatArray
from carstage.vector_map import Lane, Signal, StopLine, VectorMap
from carstage.vector_map.model import DRIVEN_TYPES, LIGHT_TYPE, STOP_SIGN_TYPE, WALKED_TYPES

VERSION: Final = "1.3"
LOCATIONS: Final = {
    "singapore-onenorth": "53992ee3023e5494b90c316c183be829",
    "singapore-hollandvillage": "37819e65e09e5547b8a3ceaefba56bb2",
    "singapore-queenstown": "93406b464a165eaba6d9de76ca09f5da",
    "boston-seaport": "36092f0b03a857c6a3403e25b4b7aab3",
}
"""The devkit's locations, and the files of their masks by which its ``BitMap`` finds them."""
_LAYERS: Final = (
    "drivable_area", "road_segment", "road_block", "lane", "ped_crossing", "walkway", "stop_line",
    "carpark_area", "road_divider", "lane_divider", "traffic_light", "lane_connector",
)  # fmt: skip
_STOP_DEPTH_M: Final = 0.4
_LIGHT_ARROW_M: Final = 1.0
_LIGHT_COLOURS: Final = ("RED", "YELLOW", "GREEN")
_YIELD_SIGN_TYPE: Final = "205"


def map_expansion(
    town: VectorMap, name: str, shift_m: tuple[float, float], size_m: tuple[float, float]
) -> dict[str, Any]:
    """The content of ``maps/expansion/LOCATION.json``.

    What reaches into the canvas is there as a whole, the rest of a town is left out.

    Args:
        town: the vector map.
        name: of the town; tokens follow from it.
        shift_m: what is added to east and north.
        size_m: width and height of the canvas.
    """
    shapes = MapShapes(name, shift_m, size_m)
    lanes = [lane for lane in town.lanes if shapes.on_canvas(lane.centre_line)]
    roads = road_layers(town, lanes, shapes)
    layers: dict[str, Records] = {layer: [] for layer in _LAYERS} | roads.records
    layers["walkway"] = _walkways(lanes, shapes)
    layers["carpark_area"] = _carparks(lanes, roads, shapes)
    layers["ped_crossing"] = _crossings(town, roads, shapes)
    layers["traffic_light"], lights = _lights(town, roads, shapes)
    layers["stop_line"] = list(_stop_lines(town, roads, lights, shapes))
    return {
        "version": VERSION,
        "canvas_edge": list(size_m),
        **shapes.layers(),
        **layers,
        "arcline_path_3": roads.paths,
        "connectivity": roads.connectivity,
    }


def surface_cells_of(town: VectorMap, shift_m: tuple[float, float]) -> NDArray[np.int32]:
    """Cells ``(N, 2)`` east and north, of 0.5 m, of lanes that are driven, parked or walked on."""
    kinds = (*DRIVEN_TYPES, *WALKED_TYPES, "parking")
    found = [np.zeros((0, 2), np.int32)]
    for lane in town.lanes:
        if lane.type not in kinds:
            continue
        left, right = lane.left_boundary[:, :2], lane.right_boundary[:, :2]
        steps = np.maximum(*(np.hypot(*np.diff(line, axis=0).T) for line in (left, right)))
        pieces = np.maximum(np.ceil(steps / (CELL_M / 2)), 1).astype(int)
        at = np.concatenate(
            [np.arange(count) / count + first for first, count in enumerate(pieces.tolist())]
            + [np.array([float(len(pieces))])]
        )
        index = np.arange(len(left))
        sides = [
            np.stack([np.interp(at, index, line[:, axis]) for axis in (0, 1)], axis=-1)
            for line in (left, right)
        ]
        count = math.ceil(float(lane.width_m.max()) / (CELL_M / 2)) + 1
        share = np.linspace(0.0, 1.0, count)[:, None, None]
        places = (sides[0] * (1.0 - share) + sides[1] * share).reshape(-1, 2)
        cells = np.floor((places * (1.0, -1.0) + shift_m) / CELL_M).astype(np.int32)
        found.append(np.unique(cells, axis=0))
    return np.concatenate(found)


def _walkways(lanes: list[Lane], shapes: MapShapes) -> Records:
    areas = [
        area
        for lane in lanes
        if lane.type in WALKED_TYPES
        for area in [lane_area(lane, shapes)]
        if area is not None
    ]
    polygons = [shapes.add_polygon(area) for area in joined(areas)]
    return [{"token": shapes.token("walkway", one), "polygon_token": one} for one in polygons]


def _carparks(lanes: list[Lane], roads: RoadLayers, shapes: MapShapes) -> Records:
    found = []
    for lane in lanes:
        if lane.type != "parking" or lane.id not in roads.areas:
            continue
        ahead = np.diff(shapes.flat(lane.centre_line)[[0, -1]], axis=0)[0]
        beside = (lane.left_neighbour, lane.right_neighbour)
        blocks = [roads.block_of[one] for one in beside if one in roads.block_of]
        found.append(
            {
                "token": shapes.token("carpark_area", lane.id),
                "polygon_token": shapes.add_polygon(roads.areas[lane.id]),
                "orientation": round(math.atan2(ahead[1], ahead[0]), 6),
                "road_block_token": blocks[0] if blocks else "",
            }
        )
    return found


def _crossings(town: VectorMap, roads: RoadLayers, shapes: MapShapes) -> Records:
    segments = {
        lane.road_id: roads.segment_of[lane.id]
        for lane in town.lanes
        if lane.id in roads.segment_of
    }
    found = []
    for number, walk in enumerate(town.crosswalks):
        area = shapes.area(shapes.flat(walk.outline)) if shapes.on_canvas(walk.outline) else None
        if area is not None:
            found.append(
                {
                    "token": shapes.token("ped_crossing", number),
                    "polygon_token": shapes.add_polygon(area),
                    "road_segment_token": segments.get(walk.road_id, ""),
                }
            )
    return found


def _lights(
    town: VectorMap, roads: RoadLayers, shapes: MapShapes
) -> tuple[Records, dict[str, str]]:
    """Rows, and their tokens by the id of the signal."""
    stops = {signal: stop.lanes for stop in town.stop_lines for signal in stop.signals}
    found, names = [], {}
    for signal in town.signals:
        lanes = [
            town.lane_by_id[one]
            for one in (*stops.get(signal.id, ()), *signal.lanes)
            if one in town.lane_by_id
        ]
        if signal.type != LIGHT_TYPE or not lanes or not shapes.on_canvas(signal.place[None]):
            continue
        name = names[signal.id] = shapes.token("traffic_light", signal.id)
        found.append(_light(signal, lanes[0], name, roads, shapes))
    return found, names


def _light(
    signal: Signal, lane: Lane, name: str, roads: RoadLayers, shapes: MapShapes
) -> dict[str, Any]:
    """A light that faces those who come along a lane."""
    place = shapes.flat(signal.place[None])[0]
    facing = -_direction(shapes.flat(lane.centre_line[-2:]))
    pose = {
        **dict.fromkeys(("rx", "ry"), 0.0),
        "rz": round(math.atan2(facing[1], facing[0]), 6),
        **dict(zip(("tx", "ty", "tz"), [*place.tolist(), float(signal.place[2])], strict=True)),
    }
    nowhere = dict.fromkeys(("tx", "ty", "tz", "rx", "ry", "rz"), 0.0)
    return {
        "token": name,
        "line_token": shapes.add_line(np.stack([place, place + facing * _LIGHT_ARROW_M])),
        "traffic_light_type": "VERTICAL",
        "from_road_block_token": roads.block_of.get(lane.id, ""),
        "items": [
            {"color": colour, "shape": "CIRCLE", "rel_pos": nowhere, "to_road_block_tokens": []}
            for colour in _LIGHT_COLOURS
        ],
        "pose": pose,
    }


def _stop_lines(
    town: VectorMap, roads: RoadLayers, lights: dict[str, str], shapes: MapShapes
) -> Iterator[dict[str, Any]]:
    types = {signal.id: signal.type for signal in town.signals}
    for number, stop in enumerate(town.stop_lines):
        if not shapes.on_canvas(stop.line):
            continue
        area = shapes.area(_stop_area(stop, shapes))
        if area is None:
            continue
        kinds = {types.get(signal) for signal in stop.signals}
        kind = "TURN_STOP"
        for known, word in (
            (_YIELD_SIGN_TYPE, "YIELD"),
            (STOP_SIGN_TYPE, "STOP_SIGN"),
            (LIGHT_TYPE, "TRAFFIC_LIGHT"),
        ):
            kind = word if known in kinds else kind
        yield {
            "token": shapes.token("stop_line", number),
            "polygon_token": shapes.add_polygon(area),
            "stop_line_type": kind,
            "ped_crossing_tokens": [],
            "traffic_light_tokens": [lights[one] for one in stop.signals if one in lights],
            "road_block_token": next(
                (roads.block_of[one] for one in stop.lanes if one in roads.block_of), ""
            ),
        }


def _stop_area(stop: StopLine, shapes: MapShapes) -> FloatArray:
    """A rectangle around a line, ``(4, 2)``."""
    ends = shapes.flat(stop.line)[[0, -1]]
    along = _direction(ends)
    across = np.array([-along[1], along[0]]) * (_STOP_DEPTH_M / 2)
    return np.stack([ends[0] - across, ends[1] - across, ends[1] + across, ends[0] + across])


def _direction(ends: FloatArray) -> FloatArray:
    step = ends[-1] - ends[0]
    return np.asarray(step / max(float(np.hypot(*step)), 1e-9))
