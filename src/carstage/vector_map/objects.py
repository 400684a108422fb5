"""Crosswalks, stop lines and signals of a road.

ASAM OpenDRIVE 1.6, sections 11 (objects, their outlines 11.3) and 12 (signals 12.1, the lanes that
they are for 12.1.1, references 12.3). Stop lines have no type of their own: RoadRunner and CARLA's
towns name such objects ``StopLine``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from lxml import etree

from carstage.geometry import FloatArray
from carstage.vector_map.document import (
    FARTHEST_M,
    MOST_ROAD_M,
    Network,
    Road,
    number,
    refuse,
    whole,
    word,
)
from carstage.vector_map.lanes import carla_places, lane_id
from carstage.vector_map.links import Links
from carstage.vector_map.model import (
    LIGHT_TYPE,
    STOP_SIGN_TYPE,
    Crosswalk,
    Lane,
    Signal,
    StopLine,
)

SPEED_LIMIT = "274"
_STOPPING = (LIGHT_TYPE, STOP_SIGN_TYPE)
_NOBODY_DRIVES = {"none", "sidewalk", "walking", "border", "curb", "median", "shoulder"}
_THIN_M = 0.01
_SPEED_SIGN = re.compile(r"speed_([0-9]{1,3})", re.IGNORECASE)


def crosswalks(road: Road) -> Iterator[Crosswalk]:
    """The pedestrian crossings of a road, closed.

    Raises:
        VectorMapError: an outline is not to be read.
    """
    for element in road.element.iterfind("objects/object"):
        if word(element, "type").lower() == "crosswalk":
            corners = corners_of(road, element)
            if len(corners) >= 3:
                ring = corners if np.allclose(corners[0], corners[-1]) else [*corners, corners[0]]
                outline = np.array(ring, np.float64)
                yield Crosswalk(
                    object_id(road, element), road.number, word(element, "name"), outline
                )


def painted_stop_lines(road: Road, lanes: Mapping[str, Lane]) -> Iterator[StopLine]:
    """The stop lines that the map has as objects; of a broad one, its middle.

    Raises:
        VectorMapError: an outline is not to be read.
    """
    for element in road.element.iterfind("objects/object"):
        name = word(element, "name").lower().replace("_", "").replace(" ", "")
        if not name.startswith("stopline"):
            continue
        corners = np.array(corners_of(road, element), np.float64)
        if len(corners) < 2:
            continue
        line = _middle_line(corners)
        ended = tuple(
            sorted(lane for lane in lanes_at_station(road, element) if _ends(lanes, lane, line))
        )
        yield StopLine(object_id(road, element), road.number, line, ended, (), "object")


def signals(
    network: Network, lanes: Mapping[str, Lane], predecessors: Links
) -> tuple[list[Signal], list[StopLine]]:
    """All signals once, with the lanes that they or references to them are for, and stop lines.

    Raises:
        VectorMapError: a signal is not to be read.
    """
    governed: dict[str, dict[str, None]] = {}
    stops: dict[str, dict[str, None]] = {}
    stands: dict[str, tuple[Road, etree._Element]] = {}
    for road in network.roads.values():
        for element in road.element.iterfind("signals/signal"):
            stands.setdefault(word(element, "id"), (road, element))
    for road in network.roads.values():
        for element in road.element.iterfind("signals/*"):
            if element.tag not in ("signal", "signalReference"):
                continue
            signal = word(element, "id")
            kind = word(stands[signal][1], "type") if signal in stands else ""
            for lane in _governed(road, element):
                governed.setdefault(signal, {})[lane] = None
                if kind in _STOPPING and lanes[lane].type.lower() not in _NOBODY_DRIVES:
                    for stop in _stops(road, element, lane, lanes, predecessors):
                        stops.setdefault(stop, {})[signal] = None
        for element in road.element.iterfind("objects/object"):
            name = word(element, "id")
            if _SPEED_SIGN.fullmatch(word(element, "name")) and name not in stands:
                stands[name] = road, element
                governed[name] = dict.fromkeys(_beside(road, element))
    found = [
        _signal(road, element, tuple(governed.get(name, ())), network.controllers.get(name, ()))
        for name, (road, element) in stands.items()
    ]
    return found, [_stop_line(lanes, stop, tuple(sorted(names))) for stop, names in stops.items()]


def _signal(
    road: Road, element: etree._Element, lanes: tuple[str, ...], controllers: tuple[str, ...]
) -> Signal:
    where = f"road {road.number}, signal {word(element, 'id')}"
    value = number(element, "value", where, -1.0)
    kind, subtype, unit = (word(element, name) for name in ("type", "subtype", "unit"))
    limit = _SPEED_SIGN.fullmatch(word(element, "name")) if element.tag == "object" else None
    if limit is not None:  # CARLA's client takes such objects of its towns for signs, too
        value, kind, subtype, unit = float(limit[1]), SPEED_LIMIT, limit[1], "mph"
    return Signal(
        id=word(element, "id"),
        road_id=road.number,
        name=word(element, "name"),
        place=carla_places(_stands(road, element, where)),
        type=kind,
        subtype=subtype,
        country=word(element, "country"),
        value=None if value == -1.0 else value,
        unit=unit,
        dynamic=element.get("dynamic") == "yes",
        lanes=lanes,
        controllers=controllers,
    )


def _stands(road: Road, element: etree._Element, where: str) -> FloatArray:
    """Where a signal stands, in OpenDRIVE's frame: it may be elsewhere than where it applies."""
    inertial = element.find("positionInertial")
    if inertial is not None:
        return np.array([number(inertial, name, where, 0.0, FARTHEST_M) for name in "xyz"])
    s, t = station_of(road, element), number(element, "t", where, 0.0, FARTHEST_M)
    place: FloatArray = road.course.beside(np.array([s]), np.array([[t]]))[0, 0]
    place[2] += number(element, "zOffset", where, 0.0, FARTHEST_M)
    return place


def _governed(road: Road, element: etree._Element) -> list[str]:
    """The lanes there that a signal is for; without a validity, those that CARLA's client takes.

    To OpenDRIVE, orientation + is that of lanes with negative numbers. To the client, and so for
    all traffic of CARLA, it is that of lanes with positive ones.
    """
    where = f"road {road.number}, signal {word(element, 'id')}"
    ranges = [
        sorted((whole(one, "fromLane", where), whole(one, "toLane", where)))
        for one in element.iterfind("validity")
    ]
    s = station_of(road, element)
    index = _section_at(road, s)
    if index is None:
        return []
    orientation = element.get("orientation", "none")
    found = []
    for lane, record in sorted(road.sections[index].lanes.items()):
        if lane == 0:
            continue
        if ranges:
            chosen = any(low <= lane <= high for low, high in ranges)
        else:
            chosen = record.type.lower() not in _NOBODY_DRIVES and (
                orientation not in ("+", "-") or (orientation == "+") == (lane > 0)
            )
        if chosen:
            found.append(lane_id(road, index, lane))
    return found


def _beside(road: Road, element: etree._Element) -> list[str]:
    """The lanes on the side of the road where a sign stands."""
    index = _section_at(road, station_of(road, element))
    if index is None:
        return []
    side = number(element, "t", f"road {road.number}", 0.0, FARTHEST_M)
    return [
        lane_id(road, index, lane)
        for lane, record in sorted(road.sections[index].lanes.items())
        if lane * side > 0 and record.type.lower() not in _NOBODY_DRIVES
    ]


def _stops(
    road: Road,
    element: etree._Element,
    lane: str,
    lanes: Mapping[str, Lane],
    predecessors: Links,
) -> Sequence[str]:
    """Keys of the stops before a signal: a lane's end, or a lane at a station, ``lane@s``.

    A signal in a junction stops traffic before it.
    """
    if road.junction is not None and predecessors.get(lane):
        return [f"{before}@" for before in predecessors[lane] if before in lanes]
    return [f"{lane}@{station_of(road, element):.3f}"]


def _stop_line(lanes: Mapping[str, Lane], stop: str, names: tuple[str, ...]) -> StopLine:
    name, _, station = stop.partition("@")
    lane = lanes[name]
    if station:
        order = np.argsort(lane.s_m)
        ends: list[list[float]] = [
            [
                float(np.interp(float(station), lane.s_m[order], line[order, axis]))
                for axis in range(3)
            ]
            for line in (lane.left_boundary, lane.right_boundary)
        ]
    else:
        ends = [lane.left_boundary[-1].tolist(), lane.right_boundary[-1].tolist()]
    line = np.array(np.round(ends, 4) + 0.0, np.float64)
    return StopLine(stop, lane.road_id, line, (name,), names, "signal")


def corners_of(road: Road, element: etree._Element) -> list[FloatArray]:
    """Corners of an object in CARLA's frame: its first outline, else its length and width.

    Raises:
        VectorMapError: they are not to be read, or too far away.
    """
    where = f"road {road.number}, object {word(element, 'id')}"
    outline = element.find("outline")
    if outline is None:
        outline = element.find("outlines/outline")
    local: list[tuple[float, float, float]] = []
    places: list[FloatArray] = []
    for corner in () if outline is None else outline:
        if corner.tag == "cornerRoad":
            station = np.array([number(corner, "s", where, 0.0, MOST_ROAD_M)])
            across = np.array([[number(corner, "t", where, 0.0, FARTHEST_M)]])
            places.append(road.course.beside(station, across)[0, 0])
            places[-1][2] += number(corner, "dz", where, 0.0, FARTHEST_M)
        elif corner.tag == "cornerLocal":
            u, v, z = (number(corner, name, where, 0.0, FARTHEST_M) for name in "uvz")
            local.append((u, v, z))
    if not local and not places:
        half_length, half_width = (
            number(element, name, where, 0.0, FARTHEST_M) / 2 for name in ("length", "width")
        )
        if half_length > 0:
            local = [
                (along * half_length, beside * half_width, 0.0)
                for along, beside in ((-1, -1), (1, -1), (1, 1), (-1, 1))
            ]
    if local:
        places += list(placed(road, element, np.array(local)))
    found = np.array(places).reshape(-1, 3)
    if not (np.abs(found) <= FARTHEST_M).all():
        refuse(where, f"it is beyond {FARTHEST_M / 1e3:.0f} km")
    return list(carla_places(found))


def placed(road: Road, element: etree._Element, local: FloatArray) -> FloatArray:
    """Places in OpenDRIVE's frame of corners in an object's own.

    That frame is turned about the vertical alone.

    Raises:
        VectorMapError: the object's pose is not to be read.
    """
    where = f"road {road.number}, object {word(element, 'id')}"
    s, t = np.array([station_of(road, element)]), number(element, "t", where, 0.0, FARTHEST_M)
    heading = float(road.course.at(s)[1][0]) + number(element, "hdg", where, 0.0)
    origin = road.course.beside(s, np.array([[t]]))[0, 0]
    origin[2] += number(element, "zOffset", where, 0.0, FARTHEST_M)
    c, sine = np.cos(heading), np.sin(heading)
    u, v, z = local.T
    return np.asarray(origin + np.stack([c * u - sine * v, sine * u + c * v, z], axis=1))


def _middle_line(corners: FloatArray) -> FloatArray:
    """From one end to the other of what is long and thin, along its longer side."""
    flat = corners[:, :2] - corners[:, :2].mean(axis=0)
    _, spread, axes = np.linalg.svd(flat, full_matrices=False)
    along = flat @ axes[0]
    if len(spread) > 1 and spread[1] > _THIN_M:
        low, high = along.min(), along.max()
        ends = np.array([low, high])[:, None] * axes[0] + corners[:, :2].mean(axis=0)
        heights = [corners[np.argmin(along), 2], corners[np.argmax(along), 2]]
        return np.round(np.column_stack([ends, heights]), 4) + 0.0
    return corners[np.argsort(along)]


def lanes_at_station(road: Road, element: etree._Element) -> list[str]:
    """Ids of the lanes at an object's station that somebody drives on."""
    index = _section_at(road, station_of(road, element))
    if index is None:
        return []
    lanes = road.sections[index].lanes
    return [
        lane_id(road, index, lane)
        for lane, record in lanes.items()
        if lane and record.type.lower() not in _NOBODY_DRIVES
    ]


def _ends(lanes: Mapping[str, Lane], name: str, line: FloatArray) -> bool:
    """Whether a lane's middle runs over a line."""
    a, b = lanes[name].centre_line[:-1, :2], lanes[name].centre_line[1:, :2]
    p, q = line[0, :2], line[-1, :2]
    return bool(
        ((_side(p, q, a) * _side(p, q, b) <= 0) & (_side(a, b, p) * _side(a, b, q) <= 0)).any()
    )


def _side(begin: FloatArray, end: FloatArray, place: FloatArray) -> FloatArray:
    """On which side of a line a place is, by sign."""
    way, to = end - begin, place - begin
    return np.asarray(way[..., 0] * to[..., 1] - way[..., 1] * to[..., 0])


def station_of(road: Road, element: etree._Element) -> float:
    """The station of an object or a signal on its road (m).

    Raises:
        VectorMapError: it has none.
    """
    where = f"road {road.number}, <{element.tag}> {word(element, 'id')}"
    return min(max(number(element, "s", where, 0.0, MOST_ROAD_M), 0.0), road.length_m)


def _section_at(road: Road, s: float) -> int | None:
    begun = [index for index, section in enumerate(road.sections) if section.begin_m <= s]
    return begun[-1] if begun else (0 if road.sections else None)


def object_id(road: Road, element: etree._Element) -> str:
    """The id of an object, else its road and station."""
    return word(element, "id") or f"{road.number}@{word(element, 's')}"
