"""Objects of a road that are painted on it: arrows, words, lines and hatched areas.

ASAM OpenDRIVE 1.8, section 13, has them as objects of type ``roadMark``, and the ways of an arrow
in their subtype, such as ``arrowStraightLeft``. RoadRunner, which made CARLA's towns, says what an
object is by its name alone: ``Stencil_ArrowType4R``, ``Stencil_STOP``, ``SolidSingleWhite``,
``ChevronRegion``. The types of its arrows are those of California's Standard Plan A24A.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np
from lxml import etree

from carstage.geometry import FloatArray
from carstage.vector_map.document import FARTHEST_M, Road, number, word
from carstage.vector_map.lanes import carla_places
from carstage.vector_map.model import Lane, PaintedObject
from carstage.vector_map.objects import (
    corners_of,
    lanes_at_station,
    object_id,
    placed,
    station_of,
)

LINE_WIDTH_M: Final = 0.125
"""Of a line of which the map has the middle alone: that of the lane lines of CARLA's towns."""
_ARROW: Final = re.compile(r"stencil_arrowtype([1-8])(?:short|medium|long)?([lrb]?)", re.IGNORECASE)
_ARROW_WAYS: Final = re.compile(r"arrow((?:left|straight|right)+)", re.IGNORECASE)
_TEXT: Final = re.compile(r"stencil_(\w+)", re.IGNORECASE)
_LINE: Final = re.compile(r"(solid|dashed)(?:short|long)?(?:single|double)(?:white|yellow)", re.I)
_REGION: Final = re.compile(r"(chevron|crosshatch)region", re.IGNORECASE)
_SIDES: Final = {"l": ("left",), "r": ("right",), "b": ("left", "right"), "": ()}
_WAYS: Final = ("left", "straight", "right")


def painted_objects(road: Road, lanes: Mapping[str, Lane]) -> Iterator[PaintedObject]:
    """What is painted on a road apart from lane lines, stop lines and crosswalks.

    Raises:
        VectorMapError: an outline is not to be read.
    """
    for element in road.element.iterfind("objects/object"):
        found = _kind(element)
        if found is None:
            continue
        kind, subtype = found
        outline = _outline(road, element, kind)
        if len(outline) < 4:
            continue
        name = word(element, "name")
        yield PaintedObject(
            id=object_id(road, element),
            road_id=road.number,
            name=name,
            type=kind,
            subtype=subtype,
            colour="yellow" if "yellow" in name.lower() else "white",
            outline=outline,
            lanes=_lanes_below(road, element, lanes, outline[:-1].mean(axis=0)),
        )


def _kind(element: etree._Element) -> tuple[str, str] | None:
    """What an object is, and which; None: it is not painted, or is read elsewhere."""
    name, subtype = word(element, "name"), word(element, "subtype")
    is_mark = word(element, "type").lower() == "roadmark"
    if found := _ARROW.fullmatch(name):
        return "arrow", " ".join(_ways(found[1], found[2].lower()))
    if is_mark and (found := _ARROW_WAYS.fullmatch(subtype)):
        return "arrow", " ".join(way for way in _WAYS if way in found[1].lower())
    if found := _TEXT.fullmatch(name):
        return "text", found[1]
    if found := _LINE.fullmatch(name):
        return "line", "solid" if found[1].lower() == "solid" else "broken"
    if found := _REGION.fullmatch(name):
        return "region", found[1].lower()
    if is_mark and not name.lower().startswith("stopline"):
        return ("text" if subtype.lower() == "text" else "region"), subtype
    return None


def _ways(number_of_type: str, side: str) -> tuple[str, ...]:
    """Where an arrow of a type of Standard Plan A24A leads; empty where it is not known."""
    if number_of_type == "1":
        return ("straight",)
    if number_of_type == "4":
        return _SIDES[side]
    if number_of_type == "7":
        return tuple(way for way in _WAYS if way == "straight" or way in _SIDES[side])
    return _WAYS if number_of_type == "8" else ()


def _outline(road: Road, element: etree._Element, kind: str) -> FloatArray:
    """The closed outline ``(N, 3)``; of fewer than three corners, an empty one."""
    is_outlined = element.find("outline") is not None or element.find("outlines") is not None
    if kind == "arrow" and not is_outlined:
        places = _arrow_rectangle(road, element)
    else:
        places = np.array(corners_of(road, element), np.float64).reshape(-1, 3)
        if kind == "line" and is_outlined:
            places = _ribbon(places)
    if len(places) < 3:
        return np.zeros((0, 3))
    return places if np.allclose(places[0], places[-1]) else np.concatenate([places, places[:1]])


def _arrow_rectangle(road: Road, element: etree._Element) -> FloatArray:
    """An arrow is longer than wide; towns of CARLA have the two numbers in either order."""
    where = f"road {road.number}, object {object_id(road, element)}"
    sides = [number(element, name, where, 0.0, FARTHEST_M) / 2 for name in ("length", "width")]
    along, beside = max(sides), min(sides)
    if beside <= 0.0:
        return np.zeros((0, 3))
    local = np.array(
        [[u * along, v * beside, 0.0] for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )
    return carla_places(placed(road, element, local))


def _ribbon(line: FloatArray) -> FloatArray:
    """The outline of a line as wide as its paint."""
    step = np.diff(line[:, :2], axis=0)
    size = np.hypot(step[:, 0], step[:, 1])
    moves = size > 1e-6
    line, step, size = line[np.append(moves, True)], step[moves], size[moves]
    if not len(step):
        return np.zeros((0, 3))
    normal = np.stack([-step[:, 1], step[:, 0]], axis=-1) / size[:, None]
    beside = np.concatenate([normal[:1], normal[:-1] + normal[1:], normal[-1:]])
    beside /= np.maximum(np.hypot(beside[:, 0], beside[:, 1]), 1e-9)[:, None]
    offset = np.zeros_like(line)
    offset[:, :2] = beside * (LINE_WIDTH_M / 2)
    return np.asarray(np.round(np.concatenate([line - offset, (line + offset)[::-1]]), 4) + 0.0)


def _lanes_below(
    road: Road, element: etree._Element, lanes: Mapping[str, Lane], middle: FloatArray
) -> tuple[str, ...]:
    """The lanes at an object's station whose width holds its middle."""
    s_m = station_of(road, element)
    found = []
    for name in sorted(lanes_at_station(road, element)):
        lane = lanes[name]
        order = np.argsort(lane.s_m)
        left, right = (
            np.array([np.interp(s_m, lane.s_m[order], line[order, axis]) for axis in (0, 1)])
            for line in (lane.left_boundary, lane.right_boundary)
        )
        across = right - left
        share = float((middle[:2] - left) @ across) / max(float(across @ across), 1e-9)
        if 0.0 <= share <= 1.0:
            found.append(name)
    return tuple(found)
