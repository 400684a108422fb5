"""Which lane leads to which.

ASAM OpenDRIVE 1.6, sections 8.2 (links of roads), 9.4 (links of lanes), 10.3 (junctions).
"""

from __future__ import annotations

from carstage.vector_map.document import Link, Network, Road
from carstage.vector_map.lanes import is_forward, lane_id

Links = dict[str, tuple[str, ...]]


def lane_links(network: Network) -> tuple[Links, Links]:
    """Successors and predecessors of lanes by their ids, in the direction of travel.

    A lane leads where the map says that it leads; from where one comes follows from that.
    """
    successors: Links = {}
    predecessors: dict[str, dict[str, None]] = {}
    approaches = _approaches(network)
    for road in network.roads.values():
        for number, section in enumerate(road.sections):
            for lane in section.lanes:
                if lane == 0:
                    continue
                here = lane_id(road, number, lane)
                ways = dict.fromkeys(_ways_on(network, approaches, road, number, lane))
                if ways:
                    successors[here] = tuple(ways)
                for way in ways:
                    predecessors.setdefault(way, {})[here] = None
    return successors, {lane: tuple(found) for lane, found in predecessors.items()}


Approaches = dict[tuple[int, int, int], list[tuple[int, bool, int]]]
"""Road, at its start or not, and lane, by junction, incoming road and its lane."""


def _approaches(network: Network) -> Approaches:
    found: Approaches = {}
    for junction in network.junctions.values():
        for connection in junction.connections:
            for begin, end in connection.lanes:
                found.setdefault((junction.number, connection.incoming, begin), []).append(
                    (connection.connecting, connection.at_start, end)
                )
    return found


def _ways_on(
    network: Network, approaches: Approaches, road: Road, section: int, lane: int
) -> list[str]:
    record = road.sections[section].lanes[lane]
    forward = is_forward(road, lane)
    ahead = record.successor if forward else record.predecessor
    following = section + (1 if forward else -1)
    if 0 <= following < len(road.sections):
        found = ahead is not None and ahead != 0 and ahead in road.sections[following].lanes
        return [lane_id(road, following, ahead)] if found and ahead is not None else []
    link: Link | None = road.successor if forward else road.predecessor
    if link is None:
        return []
    if link.kind == "road":
        pairs = [] if ahead is None else [(link.number, link.at_start, ahead)]
    else:
        pairs = approaches.get((link.number, road.number, lane), [])
    return [way for pair in pairs if (way := _entered(network, *pair)) is not None]


def _entered(network: Network, number: int, at_start: bool, lane: int) -> str | None:
    """The id of a lane at an end of a road; None: there is none."""
    road = network.roads.get(number)
    if road is None or not road.sections or lane == 0:
        return None
    section = 0 if at_start else len(road.sections) - 1
    return lane_id(road, section, lane) if lane in road.sections[section].lanes else None
