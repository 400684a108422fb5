"""Reads an OpenDRIVE text into checked numbers; refuses what no map can be made of, in words.

Elements and attributes are those of ASAM OpenDRIVE 1.4 to 1.7; what a map does not need is skipped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NoReturn

from lxml import etree

from carstage.errors import VectorMapError
from carstage.vector_map.course import Course, Cubics, Piece

LARGEST_TEXT_BYTES = 128 << 20
"""CARLA's largest town has 90 million."""
MOST_ROADS = 20_000
MOST_ROAD_M = 5_000_000.0
MOST_LANES = 1000
"""On one side of a road."""
FARTHEST_M = 1_000_000.0
WIDEST_M = 500.0
SHARPEST_PER_M = 10.0
"""A radius of 10 cm."""
_LONGEST_WORD = 200
_SHORTEST_M = 1e-6
_LARGEST_FACTOR = 1e30
_OTHER_WAY_ROUND = {"solid broken": "broken solid", "broken solid": "solid broken"}
_WAY_OUT = "Mend the map there, or turn labels.vector_map off."


@dataclass(frozen=True, slots=True)
class RoadMark:
    """``<roadMark>``; ``s_m`` counts from the section's begin."""

    s_m: float
    type: str
    colour: str
    width_m: float
    lane_change: str


@dataclass(frozen=True, slots=True)
class Speed:
    """``<speed>``; ``s_m`` counts along the road."""

    s_m: float
    limit_m_s: float | None


@dataclass(frozen=True, slots=True, eq=False)
class LaneRecord:
    """``<lane>``: polynomials count from the section's begin.

    Attributes:
        is_border: ``width`` is the distance of the outer border from the middle, not a width.
        heights: ``(s, inner, outer)`` above the road.
        predecessor, successor: numbers of lanes; None: there is none.
    """

    number: int
    type: str
    width: Cubics
    is_border: bool
    heights: tuple[tuple[float, float, float], ...]
    marks: tuple[RoadMark, ...]
    speeds: tuple[Speed, ...]
    predecessor: int | None
    successor: int | None


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """``<laneSection>``, from ``begin_m`` to ``end_m``; lanes by number, also the middle one."""

    begin_m: float
    end_m: float
    lanes: dict[int, LaneRecord]


@dataclass(frozen=True, slots=True)
class Link:
    """What a road leads to: a road at one of its ends, or a junction."""

    kind: str
    number: int
    at_start: bool


@dataclass(frozen=True, slots=True, eq=False)
class Road:
    """``<road>``; ``element`` holds its objects and signals."""

    number: int
    junction: int | None
    length_m: float
    left_hand: bool
    course: Course
    sections: tuple[Section, ...]
    speeds: tuple[Speed, ...]
    predecessor: Link | None
    successor: Link | None
    element: etree._Element


@dataclass(frozen=True, slots=True)
class Connection:
    """``<connection>`` of a junction: pairs of lanes from the incoming to the connecting road."""

    incoming: int
    connecting: int
    at_start: bool
    lanes: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class JunctionRecord:
    """``<junction>``."""

    number: int
    name: str
    connections: tuple[Connection, ...]
    controllers: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """A whole document; ``controllers`` are ids by the id of the signal that they switch."""

    roads: dict[int, Road]
    junctions: dict[int, JunctionRecord]
    controllers: dict[str, tuple[str, ...]]


def refuse(where: str, what: str) -> NoReturn:
    """Give up, with the way out that a user has.

    Raises:
        VectorMapError: always.
    """
    raise VectorMapError(f"The town's OpenDRIVE text, {where}: {what}.", _WAY_OUT)


def number(
    element: etree._Element, name: str, where: str, given: float | None = None, most: float = 1e9
) -> float:
    """A finite number of an attribute.

    Args:
        element: has the attribute.
        name: the attribute's.
        where: in the map, for the message.
        given: what it is where the attribute is missing; None: it must be there.
        most: how large it may be, either side of 0.

    Raises:
        VectorMapError: it is none, or too large.
    """
    text = element.get(name)
    if text is None or not text.strip():
        if given is None:
            refuse(where, f"<{element.tag}> has no {name}")
        return given
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= most:
        refuse(where, f'{name}="{text[:40]}" of <{element.tag}> is no number up to {most:g}')
    return value


def whole(element: etree._Element, name: str, where: str) -> int:
    """A whole number of an attribute, as CARLA numbers roads, lanes and junctions.

    Raises:
        VectorMapError: it is none.
    """
    text = element.get(name, "")
    try:
        value = int(text)
    except ValueError:
        value = 1 << 63
    if not abs(value) < 1 << 62:
        refuse(where, f'{name}="{text[:40]}" of <{element.tag}> is no whole number')
    return value


def word(element: etree._Element, name: str, given: str = "") -> str:
    """A text of an attribute, cut where it is longer than any name."""
    return str(element.get(name, given))[:_LONGEST_WORD]


def read_network(text: str | bytes) -> Network:
    """Read a document.

    Raises:
        VectorMapError: it is no OpenDRIVE, or something in it cannot be.
    """
    root = _root(text)
    roads: dict[int, Road] = {}
    left_m = MOST_ROAD_M
    for element in root.iterfind("road"):
        road = _road(element)
        if road.number in roads:
            refuse(f"road {road.number}", "two roads have this id")
        roads[road.number] = road
        left_m -= road.length_m
        if len(roads) > MOST_ROADS or left_m < 0:
            refuse(
                f"road {road.number}",
                f"more than {MOST_ROADS} roads or {MOST_ROAD_M / 1e3:.0f} km are no town",
            )
    junctions = {one.number: one for one in map(_junction, root.iterfind("junction"))}
    controllers: dict[str, tuple[str, ...]] = {}
    for controller in root.iterfind("controller"):
        for control in controller.iterfind("control"):
            signal = word(control, "signalId")
            controllers[signal] = (*controllers.get(signal, ()), word(controller, "id"))
    return Network(roads, junctions, controllers)


def _root(text: str | bytes) -> etree._Element:
    try:
        content = text.encode() if isinstance(text, str) else text
    except UnicodeEncodeError as error:
        refuse("its characters", error.reason)
    if len(content) > LARGEST_TEXT_BYTES:
        refuse("as a whole", f"{len(content)} bytes are more than {LARGEST_TEXT_BYTES}")
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        refuse("at its head", "it declares a DOCTYPE or entities, which no map needs")
    parser = etree.XMLParser(
        encoding="utf-8",
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        remove_comments=True,
        remove_pis=True,
        remove_blank_text=True,
    )
    try:
        root = etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        refuse("as a whole", f"it is no well-formed XML: {error.msg}")
    if None in root.nsmap:  # a default namespace, which CARLA's reader does not know
        for element in root.iter("{*}*"):
            if element.prefix is None:
                element.tag = etree.QName(element).localname
    if root.tag != "OpenDRIVE":
        refuse("as a whole", f"its root is <{str(root.tag)[:80]}>, not <OpenDRIVE>")
    _name_strokes_from_inside(root)
    return root


def _name_strokes_from_inside(root: etree._Element) -> None:
    """Turn the strokes of double lines round on the left side of RoadRunner's roads.

    It names them from left to right there, too, the standard from inside to outside. So say the
    turn lanes in the middle of Town03's roads, whose own strokes are broken.
    """
    if any(scene.get("program") == "RoadRunner" for scene in root.iter("vectorScene")):
        for mark in root.iterfind("road/lanes/laneSection/left/lane/roadMark"):
            turned = _OTHER_WAY_ROUND.get(mark.get("type", "").lower())
            if turned is not None:
                mark.set("type", turned)


def _road(element: etree._Element) -> Road:
    road_id = whole(element, "id", "a road")
    where = f"road {road_id}"
    length_m = number(element, "length", where, most=MOST_ROAD_M)
    if length_m < 0:
        refuse(where, f"a length of {length_m:g} m")
    pieces = tuple(_pieces(element, where))
    if not pieces:
        refuse(where, "its <planView> has no <geometry>")
    elevation = [_cubic(e, "s", where) for e in element.iterfind("elevationProfile/elevation")]
    offset = [_cubic(e, "s", where) for e in element.iterfind("lanes/laneOffset")]
    junction = -1 if element.get("junction") is None else whole(element, "junction", where)
    speeds = [
        Speed(number(kind, "s", where, 0.0), limit)
        for kind in element.iterfind("type")
        for limit in (_limit(speed, where) for speed in kind.iterfind("speed"))
    ]
    return Road(
        number=road_id,
        junction=None if junction < 0 else junction,
        length_m=length_m,
        left_hand=element.get("rule", "RHT") == "LHT",
        course=Course(pieces, Cubics.of(elevation), Cubics.of(offset)),
        sections=_sections(element, length_m, where),
        speeds=tuple(sorted(speeds, key=lambda speed: speed.s_m)),
        predecessor=_link(element, "predecessor", where),
        successor=_link(element, "successor", where),
        element=element,
    )


def _pieces(road: etree._Element, where: str) -> Iterator[Piece]:
    found = []
    for element in road.iterfind("planView/geometry"):
        s_m, heading, length_m = (
            number(element, name, where, most=MOST_ROAD_M) for name in ("s", "hdg", "length")
        )
        x, y = (number(element, name, where, most=FARTHEST_M) for name in ("x", "y"))
        if length_m < 0:
            refuse(where, f"a <geometry> of {length_m:g} m")
        if length_m < _SHORTEST_M:
            continue
        shape, factors = _shape(element, where)
        turn = max(map(abs, factors), default=0.0) * length_m
        if shape in ("arc", "spiral") and turn > 1000:
            refuse(where, f"a <{shape}> that turns by {turn:.0f} radians")
        found.append(Piece(s_m, x, y, heading, length_m, shape, factors))
    yield from sorted(found, key=lambda piece: piece.s_m)


def _shape(geometry: etree._Element, where: str) -> tuple[str, tuple[float, ...]]:
    for element in geometry:
        if element.tag == "line":
            return "line", ()
        if element.tag == "arc":
            return "arc", (number(element, "curvature", where, most=SHARPEST_PER_M),)
        if element.tag == "spiral":
            begin, end = (
                number(element, name, where, most=SHARPEST_PER_M)
                for name in ("curvStart", "curvEnd")
            )
            return "spiral", (begin, end)
        if element.tag == "poly3":
            return "poly3", tuple(number(element, name, where, 0.0) for name in "abcd")
        if element.tag == "paramPoly3":
            names = ("aU", "bU", "cU", "dU", "aV", "bV", "cV", "dV")
            factors = tuple(number(element, name, where, 0.0) for name in names)
            by_length = element.get("pRange") == "arcLength"
            return "paramPoly3", (*factors, number(geometry, "length", where) if by_length else 1.0)
    refuse(where, "a <geometry> has none of line, arc, spiral, poly3, paramPoly3")


def _cubic(
    element: etree._Element, station: str, where: str
) -> tuple[float, float, float, float, float]:
    # Towns of CARLA have factors of 1e13, for a thousandth of a millimetre.
    a, b, c, d = (number(element, name, where, 0.0, _LARGEST_FACTOR) for name in "abcd")
    return number(element, station, where, 0.0), a, b, c, d


def _limit(element: etree._Element, where: str) -> float | None:
    text = element.get("max", "").strip()
    if text in ("no limit", "undefined", ""):
        return None
    unit = {"km/h": 1 / 3.6, "mph": 0.44704}.get(element.get("unit", "m/s"), 1.0)
    limit = number(element, "max", where) * unit
    return limit if limit > 0 else None


def _sections(road: etree._Element, length_m: float, where: str) -> tuple[Section, ...]:
    elements = road.findall("lanes/laneSection")
    begins = [number(element, "s", where, most=MOST_ROAD_M) for element in elements]
    if begins != sorted(begins) or any(begin < 0 for begin in begins):
        refuse(where, "its lane sections are not in the order of their stations")
    ends = [*begins[1:], max([length_m, *begins[-1:]])]
    return tuple(
        Section(begin, end, _lanes(element, begin, where))
        for element, begin, end in zip(elements, begins, ends, strict=True)
    )


def _lanes(section: etree._Element, begin_m: float, where: str) -> dict[int, LaneRecord]:
    lanes: dict[int, LaneRecord] = {}
    for side in ("left", "center", "right"):
        elements = section.findall(f"{side}/lane")
        if len(elements) > MOST_LANES:
            refuse(where, f"{len(elements)} lanes on one side are more than {MOST_LANES}")
        for element in elements:
            lane = _lane(element, begin_m, where)
            sides = {"left": lane.number > 0, "center": lane.number == 0}
            if not sides.get(side, lane.number < 0) or lane.number in lanes:
                refuse(where, f"a second lane {lane.number}, or it is on the wrong side")
            lanes[lane.number] = lane
    return lanes


def _lane(element: etree._Element, begin_m: float, where: str) -> LaneRecord:
    lane_id = whole(element, "id", where)
    where = f"{where}, lane {lane_id}"
    widths = element.findall("width")
    shapes = [_cubic(e, "sOffset", where) for e in (widths or element.findall("border"))]
    marks = [
        RoadMark(
            number(mark, "sOffset", where, 0.0),
            word(mark, "type", "none").lower(),
            word(mark, "color").lower(),
            max(0.0, number(mark, "width", where, 0.0, WIDEST_M)),
            word(mark, "laneChange", "both").lower(),
        )
        for mark in element.iterfind("roadMark")
    ]
    heights = [
        (
            number(height, "sOffset", where, 0.0),
            number(height, "inner", where, 0.0, WIDEST_M),
            number(height, "outer", where, 0.0, WIDEST_M),
        )
        for height in element.iterfind("height")
    ]
    speeds = [
        Speed(begin_m + number(speed, "sOffset", where, 0.0), _limit(speed, where))
        for speed in element.iterfind("speed")
    ]
    ahead, behind = element.find("link/successor"), element.find("link/predecessor")
    return LaneRecord(
        number=lane_id,
        type=word(element, "type", "none"),
        width=Cubics.of(shapes),
        is_border=not widths and bool(shapes),
        heights=tuple(sorted(heights)),
        marks=tuple(sorted(marks, key=lambda mark: mark.s_m)),
        speeds=tuple(sorted(speeds, key=lambda speed: speed.s_m)),
        predecessor=None if behind is None else whole(behind, "id", where),
        successor=None if ahead is None else whole(ahead, "id", where),
    )


def _link(road: etree._Element, name: str, where: str) -> Link | None:
    element = road.find(f"link/{name}")
    if element is None:
        return None
    kind = "junction" if element.get("elementType") == "junction" else "road"
    at_start = element.get("contactPoint", "start") != "end"
    return Link(kind, whole(element, "elementId", where), at_start)


def _junction(element: etree._Element) -> JunctionRecord:
    where = f"junction {element.get('id', '')[:40]}"
    connections = []
    for found in element.iterfind("connection"):
        road = "connectingRoad" if found.get("connectingRoad") is not None else "linkedRoad"
        if found.get("incomingRoad") is None or found.get(road) is None:
            continue  # of a virtual junction: its connections are paths beside roads
        lanes = tuple(
            (whole(lane, "from", where), whole(lane, "to", where))
            for lane in found.iterfind("laneLink")
        )
        connections.append(
            Connection(
                whole(found, "incomingRoad", where),
                whole(found, road, where),
                found.get("contactPoint", "start") != "end",
                lanes,
            )
        )
    return JunctionRecord(
        whole(element, "id", where),
        word(element, "name"),
        tuple(connections),
        tuple(word(one, "id") for one in element.iterfind("controller")),
    )
