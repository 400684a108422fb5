"""Writes a road network as OpenDRIVE 1.4.

What the CARLA client reads and how: signals turn by ``hOffset`` alone (``orientation`` is
ignored), crosswalk outlines repeat their first corner, and speed limits come from ``<type>``.
A light's ``<signal>`` stands where its pole stands, across the junction, and governs nothing there
(validity 0); the approach carries a ``<signalReference>`` at its stop line with the lanes.
"""

from __future__ import annotations

from lxml import etree

from carstage_sim.maps.writer.cubic import Cubic
from carstage_sim.maps.writer.network import (
    Crosswalk,
    Junction,
    Lane,
    LaneKind,
    LaneSection,
    Road,
    RoadMark,
    RoadNetwork,
    Signal,
    SignalReference,
)

_KERB_HEIGHT_M = 0.15


def write_opendrive(network: RoadNetwork) -> str:
    """The OpenDRIVE text; equal networks give equal text."""
    root = etree.Element("OpenDRIVE")
    header = _add(
        root, "header", revMajor=1, revMinor=4, name=network.name, version="1.00", date="",
        north=0.0, south=0.0, east=0.0, west=0.0, vendor="carstage",
    )  # fmt: skip
    reference = etree.SubElement(header, "geoReference")
    reference.text = etree.CDATA(
        f"+proj=tmerc +lat_0={network.latitude_deg} +lon_0={network.longitude_deg} +k=1 "
        "+x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs"
    )
    for road in network.roads:
        _add_road(root, road)
    for junction in network.junctions:
        for light in junction.controllers:
            controller = _add(
                root, "controller", id=light.controller_id, sequence=light.phase,
                name=f"phase {light.controller_id}",
            )  # fmt: skip
            _add(controller, "control", signalId=light.signal_id, type="")
    for junction in network.junctions:
        _add_junction(root, junction)
    text: bytes = etree.tostring(
        root, pretty_print=True, xml_declaration=True, encoding="UTF-8", standalone=True
    )
    return text.decode()


def _add(parent: etree._Element, tag: str, **attributes: object) -> etree._Element:
    return etree.SubElement(parent, tag, {k: _text(v) for k, v in attributes.items()})


def _text(value: object) -> str:
    if isinstance(value, float):
        # Adding zero turns a negative zero into a positive one.
        return f"{value + 0.0:.12g}"
    return str(value)


def _add_cubic(parent: etree._Element, tag: str, start: str, cubic: Cubic) -> None:
    attributes: dict[str, object] = {start: cubic.start_m}
    attributes |= {"a": cubic.a, "b": cubic.b, "c": cubic.c, "d": cubic.d}
    _add(parent, tag, **attributes)


def _add_road(root: etree._Element, road: Road) -> None:
    element = _add(
        root, "road", name=f"Road {road.road_id}", length=road.length_m, id=road.road_id,
        junction=road.junction_id,
    )  # fmt: skip
    link = _add(element, "link")
    for tag, end in (("predecessor", road.predecessor), ("successor", road.successor)):
        node = _add(link, tag, elementType=end.element, elementId=end.element_id)
        if end.contact:
            node.set("contactPoint", end.contact)
    kind = _add(element, "type", s=0.0, type=road.kind)
    _add(kind, "speed", max=road.speed_limit_kmh, unit="km/h")
    view = _add(element, "planView")
    s_m = 0.0
    for piece in road.alignment:
        geometry = _add(
            view, "geometry", s=s_m, x=piece.start.x, y=piece.start.y,
            hdg=piece.start.heading_rad, length=piece.length_m,
        )  # fmt: skip
        if piece.curvature_per_m:
            _add(geometry, "arc", curvature=piece.curvature_per_m)
        else:
            _add(geometry, "line")
        s_m += piece.length_m
    heights = _add(element, "elevationProfile")
    for cubic in road.heights:
        _add_cubic(heights, "elevation", "s", cubic)
    _add(element, "lateralProfile")
    lanes = _add(element, "lanes")
    _add_cubic(lanes, "laneOffset", "s", Cubic(0.0, 0.0))
    for section in road.sections:
        _add_section(lanes, section, road)
    objects = _add(element, "objects")
    for crosswalk in road.crosswalks:
        _add_crosswalk(objects, crosswalk)
    signals = _add(element, "signals")
    # The schema wants all signals before the first reference.
    for signal in sorted(road.signals, key=lambda signal: not signal.is_light):
        _add_signal(signals, signal)
    for place in road.references:
        _add_reference(signals, place)


def _add_section(lanes: etree._Element, section: LaneSection, road: Road) -> None:
    node = _add(lanes, "laneSection", s=section.start_m)
    left = [lane for lane in section.lanes if lane.lane_id > 0]
    right = [lane for lane in section.lanes if lane.lane_id < 0]
    if left:
        _add_side(node, "left", left, road.speed_limit_kmh)
    center = _add(_add(node, "center"), "lane", id=0, type="none", level="false")
    _add_mark(center, road.center_mark)
    if right:
        _add_side(node, "right", right, road.speed_limit_kmh)


def _add_side(section: etree._Element, tag: str, lanes: list[Lane], speed_limit_kmh: int) -> None:
    side = _add(section, tag)
    for lane in lanes:
        node = _add(side, "lane", id=lane.lane_id, type=lane.kind.value, level="false")
        link = _add(node, "link")
        if lane.predecessor is not None:
            _add(link, "predecessor", id=lane.predecessor)
        if lane.successor is not None:
            _add(link, "successor", id=lane.successor)
        for cubic in lane.width:
            _add_cubic(node, "width", "sOffset", cubic)
        _add_mark(node, lane.mark)
        if lane.kind is LaneKind.DRIVING:
            _add(node, "speed", sOffset=0.0, max=speed_limit_kmh, unit="km/h")
        if lane.kind is LaneKind.SIDEWALK:
            _add(node, "height", sOffset=0.0, inner=_KERB_HEIGHT_M, outer=_KERB_HEIGHT_M)


def _add_mark(lane: etree._Element, mark: RoadMark | None) -> None:
    _add(
        lane, "roadMark", sOffset=0.0, type=mark.kind if mark else "none", weight="standard",
        color=mark.color if mark else "standard", width=mark.width_m if mark else 0.0,
        laneChange=mark.lane_change if mark else "none",
    )  # fmt: skip


def _add_crosswalk(objects: etree._Element, crosswalk: Crosswalk) -> None:
    node = _add(
        objects, "object", id=crosswalk.object_id, name="SimpleCrosswalk", type="crosswalk",
        s=crosswalk.s_m, t=0.0, zOffset=0.0, orientation="none", hdg=0.0, pitch=0.0, roll=0.0,
        width=crosswalk.width_m, length=crosswalk.length_m,
    )  # fmt: skip
    outline = _add(node, "outline")
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    for u, v in corners:
        _add(
            outline, "cornerLocal", u=u * crosswalk.length_m / 2, v=v * crosswalk.width_m / 2,
            z=0.0,
        )  # fmt: skip


def _add_signal(signals: etree._Element, signal: Signal) -> None:
    attributes: dict[str, object] = {
        "id": signal.signal_id, "name": signal.name, "s": signal.s_m, "t": signal.t_m,
        "zOffset": _KERB_HEIGHT_M, "hOffset": signal.turn_rad, "roll": 0.0, "pitch": 0.0,
        "orientation": signal.orientation, "dynamic": "yes" if signal.is_light else "no",
        "country": "OpenDRIVE", "type": signal.type_code, "subtype": signal.subtype,
        "value": signal.value,
    }  # fmt: skip
    if signal.unit:
        attributes["unit"] = signal.unit
    attributes |= {"text": signal.text, "height": signal.size_m, "width": signal.size_m}
    node = _add(signals, "signal", **attributes)
    _add(node, "validity", fromLane=signal.lanes[0], toLane=signal.lanes[1])


def _add_reference(signals: etree._Element, place: SignalReference) -> None:
    node = _add(
        signals, "signalReference", id=place.signal_id, s=place.s_m, t=place.t_m,
        orientation=place.orientation,
    )  # fmt: skip
    _add(node, "validity", fromLane=place.lanes[0], toLane=place.lanes[1])


def _add_junction(root: etree._Element, junction: Junction) -> None:
    element = _add(
        root, "junction", id=junction.junction_id, name=f"Junction {junction.junction_id}"
    )
    for index, connection in enumerate(junction.connections):
        node = _add(
            element, "connection", id=index, incomingRoad=connection.incoming_road,
            connectingRoad=connection.connecting_road, contactPoint="start",
        )  # fmt: skip
        for source, target in connection.lane_links:
            _add(node, "laneLink", **{"from": source, "to": target})
    for light in junction.controllers:
        _add(element, "controller", id=light.controller_id, type="0", sequence=light.phase)
