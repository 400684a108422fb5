"""Writes a road network as OpenDRIVE 1.4.

What the CARLA client reads and how: signals turn by ``hOffset`` alone (``orientation`` is
ignored), crosswalk outlines repeat their first corner, and speed limits come from ``<type>``.
A light's ``<signal>`` stands where its pole stands, across the junction, and governs nothing there
(validity 0); the approach carries a ``<signalReference>`` at its stop line with the lanes.
"""

from __future__ import annotations

import math

from lxml import etree

from carstage_sim.maps.alignment import length_m
from carstage_sim.maps.layout import CROSSWALK_FAR_M, CROSSWALK_NEAR_M, STOP_LINE_M
from carstage_sim.maps.network import (
    Arm,
    Junction,
    Lane,
    LaneKind,
    Light,
    Road,
    RoadNetwork,
    SpeedSign,
)

_LIGHT_TYPE = "1000001"
_SPEED_LIMIT_TYPE = "274"
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
    lights = [light for junction in network.junctions for light in junction.lights]
    arms = [arm for junction in network.junctions for arm in junction.arms]
    for road in network.roads:
        _add_road(root, road, network, arms, lights)
    for light in lights:
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
        return f"{value:.12g}"
    return str(value)


def _add_road(
    root: etree._Element,
    road: Road,
    network: RoadNetwork,
    arms: list[Arm],
    lights: list[Light],
) -> None:
    length = length_m(road.alignment)
    element = _add(
        root, "road", name=f"Road {road.road_id}", length=length, id=road.road_id,
        junction=road.junction_id,
    )  # fmt: skip
    link = _add(element, "link")
    for tag, end in (("predecessor", road.predecessor), ("successor", road.successor)):
        node = _add(link, tag, elementType=end.element, elementId=end.element_id)
        if end.contact:
            node.set("contactPoint", end.contact)
    kind = _add(element, "type", s=0.0, type="town")
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
    _add(_add(element, "elevationProfile"), "elevation", s=0.0, a=0.0, b=0.0, c=0.0, d=0.0)
    _add(element, "lateralProfile")
    _add_lanes(element, road)
    _add_crosswalks(element, road, length, arms)
    signals = _add_signals(element, road, length, lights)
    for sign in network.speed_signs:
        if sign.road_id == road.road_id:
            _add_speed_sign(signals, sign)


def _add_lanes(element: etree._Element, road: Road) -> None:
    lanes = _add(element, "lanes")
    _add(lanes, "laneOffset", s=0.0, a=0.0, b=0.0, c=0.0, d=0.0)
    section = _add(lanes, "laneSection", s=0.0)
    left = [lane for lane in road.lanes if lane.lane_id > 0]
    right = [lane for lane in road.lanes if lane.lane_id < 0]
    if left:
        _add_side(section, "left", left, road.speed_limit_kmh)
    center = _add(_add(section, "center"), "lane", id=0, type="none", level="false")
    mark = road.center_mark
    _add(
        center, "roadMark", sOffset=0.0, type=mark.kind if mark else "none", weight="standard",
        color=mark.color if mark else "standard", width=mark.width_m if mark else 0.0,
        laneChange=mark.lane_change if mark else "none",
    )  # fmt: skip
    if right:
        _add_side(section, "right", right, road.speed_limit_kmh)


def _add_side(section: etree._Element, tag: str, lanes: list[Lane], speed_limit_kmh: int) -> None:
    side = _add(section, tag)
    for lane in lanes:
        node = _add(side, "lane", id=lane.lane_id, type=lane.kind.value, level="false")
        link = _add(node, "link")
        if lane.predecessor is not None:
            _add(link, "predecessor", id=lane.predecessor)
        if lane.successor is not None:
            _add(link, "successor", id=lane.successor)
        _add(node, "width", sOffset=0.0, a=lane.width_m, b=0.0, c=0.0, d=0.0)
        mark = lane.mark
        _add(
            node, "roadMark", sOffset=0.0, type=mark.kind if mark else "none", weight="standard",
            color=mark.color if mark else "standard", width=mark.width_m if mark else 0.0,
            laneChange=mark.lane_change if mark else "none",
        )  # fmt: skip
        if lane.kind is LaneKind.DRIVING:
            _add(node, "speed", sOffset=0.0, max=speed_limit_kmh, unit="km/h")
        if lane.kind is LaneKind.SIDEWALK:
            _add(node, "height", sOffset=0.0, inner=_KERB_HEIGHT_M, outer=_KERB_HEIGHT_M)


def _station(arm: Arm, length: float, before_mouth_m: float) -> float:
    """The s on an arm's road of a place that far before the junction."""
    return length - before_mouth_m if arm.contact == "end" else before_mouth_m


def _add_crosswalks(element: etree._Element, road: Road, length: float, arms: list[Arm]) -> None:
    objects = _add(element, "objects")
    for arm in arms:
        if arm.road_id != road.road_id:
            continue
        middle = _station(arm, length, (CROSSWALK_NEAR_M + CROSSWALK_FAR_M) / 2)
        half_m = (CROSSWALK_FAR_M - CROSSWALK_NEAR_M) / 2
        node = _add(
            objects, "object", id=f"{road.road_id}{0 if arm.contact == 'start' else 1}",
            name="SimpleCrosswalk", type="crosswalk", s=middle, t=0.0, zOffset=0.0,
            orientation="none", hdg=0.0, pitch=0.0, roll=0.0, width=2 * arm.kerb_m,
            length=2 * half_m,
        )  # fmt: skip
        outline = _add(node, "outline")
        corners = ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
        for u, v in corners:
            _add(outline, "cornerLocal", u=u * half_m, v=v * arm.kerb_m, z=0.0)


def _add_signals(
    element: etree._Element, road: Road, length: float, lights: list[Light]
) -> etree._Element:
    signals = _add(element, "signals")
    for light in lights:
        if light.host_road == road.road_id:
            turn = math.remainder(light.pole.heading_rad - light.host_heading_rad, math.tau)
            node = _add(
                signals, "signal", id=light.signal_id, name=f"Light {light.signal_id}",
                s=light.host_s_m, t=light.host_t_m, zOffset=_KERB_HEIGHT_M, hOffset=turn, roll=0.0,
                pitch=0.0, orientation="none", dynamic="yes", country="OpenDRIVE",
                type=_LIGHT_TYPE, subtype="-1", value="-1", text="", height=0.0, width=0.0,
            )  # fmt: skip
            _add(node, "validity", fromLane=0, toLane=0)
    for light in lights:
        arm = light.arm
        if arm.road_id == road.road_id:
            lanes = sorted(arm.lane_id(i, inbound=True) for i in (1, arm.lanes))
            node = _add(
                signals, "signalReference", id=light.signal_id,
                s=_station(arm, length, STOP_LINE_M),
                t=math.copysign(arm.kerb_m, lanes[0]),
                orientation="+" if lanes[0] < 0 else "-",
            )  # fmt: skip
            _add(node, "validity", fromLane=lanes[0], toLane=lanes[-1])
    return signals


def _add_speed_sign(signals: etree._Element, sign: SpeedSign) -> None:
    forward = sign.lanes[0] < 0
    node = _add(
        signals, "signal", id=sign.signal_id, name=f"Speed limit {sign.limit_kmh}", s=sign.s_m,
        t=sign.t_m, zOffset=_KERB_HEIGHT_M, hOffset=math.pi if forward else 0.0, roll=0.0,
        pitch=0.0, orientation="+" if forward else "-", dynamic="no", country="OpenDRIVE",
        type=_SPEED_LIMIT_TYPE, subtype=sign.limit_kmh, value=sign.limit_kmh, unit="km/h",
        text=sign.limit_kmh, height=0.66, width=0.66,
    )  # fmt: skip
    _add(node, "validity", fromLane=sign.lanes[0], toLane=sign.lanes[1])


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
    for light in junction.lights:
        _add(element, "controller", id=light.controller_id, type="0", sequence=light.phase)
