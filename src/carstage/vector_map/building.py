"""From an OpenDRIVE text to a vector map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from carstage.geometry import convex_hull
from carstage.vector_map.document import JunctionRecord, Network, read_network, refuse
from carstage.vector_map.lanes import road_lanes
from carstage.vector_map.links import lane_links
from carstage.vector_map.model import Junction, Lane, Marking, VectorMap
from carstage.vector_map.objects import crosswalks, painted_stop_lines, signals
from carstage.vector_map.painted import painted_objects

MOST_POINTS = 10_000_000
"""Of all centre lines. CARLA's largest town has less than a tenth of it."""


def vector_map(opendrive: str | bytes) -> VectorMap:
    """The vector map of a town; one without lanes where the text has no road.

    Args:
        opendrive: the text, as ``world.get_map().to_opendrive()`` gives it.

    Raises:
        VectorMapError: the text is no OpenDRIVE document, or something in it cannot be; the message
            says where.
    """
    network = read_network(opendrive)
    lanes: list[Lane] = []
    markings: list[Marking] = []
    points = 0
    for road in network.roads.values():
        for found, painted in road_lanes(road):
            lanes += found
            markings += painted
            points += sum(len(lane.s_m) for lane in found)
            if points > MOST_POINTS:
                refuse(f"road {road.number}", f"more than {MOST_POINTS} points up to there")
    successors, predecessors = lane_links(network)
    lanes = [
        replace(
            lane,
            successors=successors.get(lane.id, ()),
            predecessors=predecessors.get(lane.id, ()),
        )
        for lane in lanes
    ]
    by_id = {lane.id: lane for lane in lanes}
    placed, derived = signals(network, by_id, predecessors)
    roads = network.roads.values()
    painted_stops = [line for road in roads for line in painted_stop_lines(road, by_id)]
    return VectorMap(
        lanes=tuple(lanes),
        markings=tuple(markings),
        junctions=tuple(_junction(one, network, lanes) for one in network.junctions.values()),
        crosswalks=tuple(walk for road in roads for walk in crosswalks(road)),
        stop_lines=(*painted_stops, *derived),
        signals=tuple(placed),
        painted_objects=tuple(one for road in roads for one in painted_objects(road, by_id)),
    )


def _junction(record: JunctionRecord, network: Network, lanes: list[Lane]) -> Junction:
    within = [lane for lane in lanes if lane.junction_id == record.number]
    lines = [line for lane in within for line in (lane.left_boundary, lane.right_boundary)]
    roads = sorted(road.number for road in network.roads.values() if road.junction == record.number)
    outline = None
    if lines:
        places = np.concatenate(lines)
        hull = convex_hull([(x, y) for x, y in places[:, :2].tolist()])
        if len(hull) >= 3:
            ring = np.array([*hull, hull[0]])
            height = np.full(len(ring), np.round(np.median(places[:, 2]), 4) + 0.0)
            outline = np.column_stack([ring, height])
    return Junction(record.number, record.name, outline, tuple(roads), record.controllers)
