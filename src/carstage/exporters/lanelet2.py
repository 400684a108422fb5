"""A vector map as Lanelet2's OSM file.

Elements, roles and tags are those of the library's documents ``LaneletPrimitives``,
``LinestringTagging``, ``LaneletAndAreaTagging`` and ``RegulatoryElementTagging``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Final

import numpy as np
from lxml import etree

from carstage.geometry import FloatArray, GeoFrame
from carstage.vector_map import Crosswalk, Lane, Signal, StopLine, VectorMap
from carstage.vector_map.model import (
    DRIVEN_TYPES,
    LIGHT_TYPE,
    STOP_SIGN_TYPE,
    WALKED_TYPES,
)

Tags = Mapping[str, str]
Way = tuple[str, ...]

_GRID_PER_M: Final = 100
_SIGNAL_HALF_M: Final = 0.2
_DIGITS: Final = 4
_SUBTYPES: Final = {
    **dict.fromkeys(DRIVEN_TYPES, "road"),
    **dict.fromkeys(WALKED_TYPES, "walkway"),
    "parking": "parking",
    "biking": "bicycle_lane",
    "stop": "emergency_lane",
}
_STROKES: Final = {
    "solid": "solid",
    "broken": "dashed",
    "botts dots": "dashed",
    "solid solid": "solid_solid",
    "solid broken": "solid_dashed",
    "broken solid": "dashed_solid",
    "broken broken": "dashed",
}
_VIRTUAL: Final[Tags] = {"type": "virtual"}


def to_lanelet2(town: VectorMap, frame: GeoFrame) -> bytes:
    """The OSM file (XML) of a map, for ``lanelet2.io.load``.

    Lanes that are driven, walked, cycled or parked on become lanelets, as crosswalks do. Lights and
    stop signs become regulatory elements with their stop lines. A boundary is one way: of several
    markings along it, the longest one counts. Nodes are on the globe, and have ``local_x`` (east)
    and ``local_y`` (north) in metres of the map.

    Args:
        town: the vector map.
        frame: how it lies on the globe.
    """
    return _File(town, frame).content()


class _File:
    def __init__(self, town: VectorMap, frame: GeoFrame) -> None:
        self._town, self._frame = town, frame
        self._places: dict[tuple[int, int, int], tuple[str, list[float]]] = {}
        self._ways: dict[Way, tuple[str, Tags]] = {}
        self._relations: list[etree._Element] = []
        self._last = 0

    def content(self) -> bytes:
        rules = self._rules()
        for lane in self._town.lanes:
            if lane.type in _SUBTYPES:
                self._lane(lane, rules.get(lane.id, ()))
        for walk in self._town.crosswalks:
            self._crosswalk(walk)
        root = etree.Element("osm", version="0.6", generator="Car-STAGE")
        root.extend(self._nodes())
        for nodes, (number, tags) in self._ways.items():
            way = etree.SubElement(root, "way", id=number, version="1")
            for node in nodes:
                etree.SubElement(way, "nd", ref=node)
            _tag(way, tags)
        root.extend(self._relations)
        content: bytes = etree.tostring(
            root, encoding="utf-8", xml_declaration=True, pretty_print=True
        )
        return content

    def _lane(self, lane: Lane, rules: Sequence[str]) -> None:
        left, right = (
            self._way(line, self._boundary_tags(marks))
            for line, marks in (
                (lane.left_boundary, lane.left_markings),
                (lane.right_boundary, lane.right_markings),
            )
        )
        if left is None or right is None:
            return
        walked = lane.type in WALKED_TYPES
        tags = {
            "type": "lanelet",
            "subtype": _SUBTYPES[lane.type],
            "location": "urban",
            "one_way": "no" if walked or lane.direction == "both" else "yes",
            "carstage_id": lane.id,
        }
        limits = [one.limit_m_s for one in lane.speed_limits if one.limit_m_s is not None]
        if limits and not walked:
            tags["speed_limit"] = f"{round(limits[0] * 3.6, 2):g} km/h"
        self._lanelet(left, right, tags, rules)

    def _crosswalk(self, walk: Crosswalk) -> None:
        """Its two longer sides are the bounds, as one walks between them."""
        corners = _four_corners(walk.outline)
        sides = [(corners[[0, 1]], corners[[3, 2]]), (corners[[1, 2]], corners[[0, 3]])]
        lengths = [sum(float(np.hypot(*(a[1] - a[0])[:2])) for a in pair) for pair in sides]
        first, second = sides[int(np.argmax(lengths))]
        # The left one has the other on its right, looked along: y of the world points right.
        ahead, beside = (first[1] - first[0])[:2], (second[0] - first[0])[:2]
        if ahead[0] * beside[1] - ahead[1] * beside[0] < 0.0:
            first, second = second, first
        left, right = (self._way(line, {"type": "pedestrian_marking"}) for line in (first, second))
        if left is not None and right is not None:
            tags = {
                "type": "lanelet",
                "subtype": "crosswalk",
                "location": "urban",
                "one_way": "no",
                "carstage_id": walk.id,
            }
            self._lanelet(left, right, tags, ())

    def _lanelet(self, left: str, right: str, tags: Tags, rules: Sequence[str]) -> None:
        members = [("way", "left", left), ("way", "right", right)]
        self._relation([*members, *(("relation", "regulatory_element", r) for r in rules)], tags)

    def _rules(self) -> dict[str, list[str]]:
        """Regulatory elements by the lane that they are for."""
        found: dict[str, list[str]] = {}
        signals = {signal.id: signal for signal in self._town.signals}
        for stop in self._town.stop_lines:
            line = self._way(stop.line, {"type": "stop_line", "subtype": "solid"})
            for name in stop.signals:
                signal = signals.get(name)
                if signal is None or line is None:
                    continue
                rule = self._rule(signal, stop, line)
                if rule is not None:
                    for lane in stop.lanes:
                        found.setdefault(lane, []).append(rule)
        return found

    def _rule(self, signal: Signal, stop: StopLine, line: str) -> str | None:
        lanes = [name for name in stop.lanes if name in self._town.lane_by_id]
        kinds = {
            LIGHT_TYPE: ("traffic_light", "red_yellow_green"),
            STOP_SIGN_TYPE: ("traffic_sign", "de206"),
        }
        if signal.type not in kinds or not lanes:
            return None
        kind, subtype = kinds[signal.type]
        # From the left to the right, as seen by those who come.
        step = np.diff(self._town.lane_by_id[lanes[0]].centre_line[-2:, :2], axis=0)[0]
        right = np.array([-step[1], step[0], 0.0]) / max(float(np.hypot(*step)), 1e-9)
        ends = signal.place + np.array([[-_SIGNAL_HALF_M], [_SIGNAL_HALF_M]]) * right
        way = self._way(ends, {"type": kind, "subtype": subtype, "carstage_id": signal.id})
        if way is None:
            return None
        members = [("way", "refers", way), ("way", "ref_line", line)]
        return self._relation(members, {"type": "regulatory_element", "subtype": kind})

    def _boundary_tags(self, marks: Sequence[str]) -> Tags:
        found = [self._town.marking_by_id[name] for name in marks]
        if not found:
            return _VIRTUAL
        mark = max(found, key=lambda one: float(one.s_m[1] - one.s_m[0]))
        if mark.type == "curb":
            return {"type": "curbstone", "subtype": "high"}
        if mark.type not in _STROKES:
            return _VIRTUAL
        changes = {"both": "yes", "none": "no"}
        tags = {
            "type": "line_thick" if mark.width_m > 0.2 else "line_thin",
            "subtype": _STROKES[mark.type],
            "color": mark.colour,
        }
        if mark.lane_change in changes:
            tags["lane_change"] = changes[mark.lane_change]
        return tags

    def _way(self, line: FloatArray, tags: Tags) -> str | None:
        """The way along places ``(N, 3)``, either way round; None: it has no length."""
        nodes = [self._node(place) for place in line.tolist()]
        kept = tuple(node for at, node in enumerate(nodes) if not at or node != nodes[at - 1])
        if len(kept) < 2:
            return None
        for known in (kept, kept[::-1]):
            if known in self._ways:
                if self._ways[known][1] == _VIRTUAL:
                    self._ways[known] = (self._ways[known][0], tags)
                return self._ways[known][0]
        self._ways[kept] = (self._number(), tags)
        return self._ways[kept][0]

    def _node(self, place: list[float]) -> str:
        """The node within 2 cm of a place, or a new one."""
        x, y, z = (round(value * _GRID_PER_M) for value in place)
        for dx, dy, dz in ((0, 0, 0), *product((-1, 0, 1), repeat=3)):
            known = self._places.get((x + dx, y + dy, z + dz))
            if known is not None:
                return known[0]
        number = self._number()
        self._places[x, y, z] = number, place
        return number

    def _nodes(self) -> list[etree._Element]:
        places = np.array([place for _, place in self._places.values()]).reshape(-1, 3)
        globe = self._frame.places(places).tolist()
        found = []
        for (number, place), (longitude, latitude, altitude) in zip(
            self._places.values(), globe, strict=True
        ):
            node = etree.Element(
                "node", id=number, lat=f"{latitude:.10f}", lon=f"{longitude:.10f}", version="1"
            )
            local = {"local_x": place[0], "local_y": -place[1], "ele": altitude}
            _tag(node, {k: f"{round(v, _DIGITS) + 0.0}" for k, v in local.items()})
            found.append(node)
        return found

    def _relation(self, members: Sequence[tuple[str, str, str]], tags: Tags) -> str:
        number = self._number()
        relation = etree.Element("relation", id=number, version="1")
        for kind, role, ref in members:
            etree.SubElement(relation, "member", type=kind, role=role, ref=ref)
        _tag(relation, tags)
        self._relations.append(relation)
        return number

    def _number(self) -> str:
        self._last += 1
        return str(self._last)


def _tag(element: etree._Element, tags: Tags) -> None:
    for key, value in tags.items():
        etree.SubElement(element, "tag", k=key, v=value)


def _four_corners(outline: FloatArray) -> FloatArray:
    """Four corners ``(4, 3)`` of a closed outline; of another shape those of its rectangle.

    The rectangle lies along the longest side, at the shape's mean height.
    """
    ring = outline[:-1]
    if len(ring) == 4:
        return ring
    sides = np.diff(outline[:, :2], axis=0)
    along = sides[np.hypot(*sides.T).argmax()]
    along = along / np.hypot(*along)
    axes = np.stack([along, [-along[1], along[0]]])
    low, high = (ring[:, :2] @ axes.T).min(axis=0), (ring[:, :2] @ axes.T).max(axis=0)
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]]) @ axes
    return np.column_stack([corners, np.full(4, ring[:, 2].mean())])
