"""The built-in towns' networks: what joins meets to the millimetre, and links agree."""

from __future__ import annotations

import dataclasses
import math
import re
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from lxml import etree

from carstage_sim.maps.writer import PLANS, opendrive_of
from carstage_sim.maps.writer.alignment import Pose2, pose_at
from carstage_sim.maps.writer.elevation import grade, height_m
from carstage_sim.maps.writer.layout import build_network
from carstage_sim.maps.writer.network import Lane, LaneKind, Road, RoadNetwork
from carstage_sim.maps.writer.opendrive_text import write_opendrive
from carstage_sim.maps.writer.plan import Street, StreetProfile, TownPlan

STEEPEST = 0.085


@pytest.fixture(scope="module", params=list(PLANS))
def network(request) -> RoadNetwork:
    return build_network(PLANS[request.param])


def lanes_at(road: Road, contact: str) -> dict[int, Lane]:
    section = road.sections[0 if contact == "start" else -1]
    return {lane.lane_id: lane for lane in section.lanes}


def width_m(road: Road, lane: Lane, contact: str) -> float:
    """Width at an end of a road."""
    section = road.sections[0 if contact == "start" else -1]
    s = 0.0 if contact == "start" else road.length_m - section.start_m
    piece = [cubic for cubic in lane.width if cubic.start_m <= s + 1e-9][-1]
    return piece.value(s)


def edges(road: Road, lane_id: int, contact: str) -> tuple[Pose2, Pose2]:
    """Inner and outer edge of a lane at an end of a road, along the road's heading."""
    sign = 1 if lane_id > 0 else -1
    lanes = lanes_at(road, contact)
    inner = sum(width_m(road, lanes[sign * i], contact) for i in range(1, abs(lane_id)))
    outer = inner + width_m(road, lanes[lane_id], contact)
    pose = pose_at(road.alignment, 0.0 if contact == "start" else road.length_m)
    return pose.moved(0.0, sign * inner), pose.moved(0.0, sign * outer)


def joints(network: RoadNetwork):
    """Pairs of (road, contact, lane) that are linked at a junction's mouths."""
    roads = {road.road_id: road for road in network.roads}
    for road in network.roads:
        if road.junction_id == -1:
            continue
        for link, contact in ((road.predecessor, "start"), (road.successor, "end")):
            for lane in road.sections[0].lanes:
                other = lane.predecessor if contact == "start" else lane.successor
                if other is not None:
                    yield (
                        (road, contact, lane.lane_id),
                        (
                            roads[link.element_id],
                            link.contact,
                            other,
                        ),
                    )


def test_joined_lanes_share_their_edges_to_the_millimetre(network):
    count = 0
    for (path, at, lane), (road, contact, other) in joints(network):
        mine, theirs = edges(path, lane, at), edges(road, other, contact)
        apart = [math.dist(a.point, b.point) for a, b in zip(mine, theirs, strict=True)]
        assert apart[1] < 1e-3, (path.road_id, road.road_id, lane, other)
        kind = lanes_at(path, at)[lane].kind
        # A gutter may take in a bicycle lane that ends there.
        assert kind is LaneKind.SHOULDER or apart[0] < 1e-3
        count += 1
    assert count > 100


def test_joined_roads_share_heading_height_and_grade(network):
    for (path, at, _), (road, contact, _) in joints(network):
        along, beside = (
            (r, 0.0 if c == "start" else r.length_m) for r, c in ((path, at), (road, contact))
        )
        flip = math.pi if at == contact else 0.0
        turn = pose_at(along[0].alignment, along[1]).heading_rad - flip
        turn -= pose_at(beside[0].alignment, beside[1]).heading_rad
        assert math.remainder(turn, math.tau) == pytest.approx(0.0, abs=1e-6)
        heights = [height_m(r.heights, s) for r, s in (along, beside)]
        assert heights[0] == pytest.approx(heights[1], abs=1e-3)
        slopes = [grade(r.heights, s) for r, s in (along, beside)]
        assert slopes == pytest.approx([0.0, 0.0], abs=1e-6)


def test_links_between_lane_sections_agree(network):
    for road in network.roads:
        for before, after in pairwise(road.sections):
            first = {lane.lane_id: lane for lane in before.lanes}
            last = {lane.lane_id: lane for lane in after.lanes}
            forward = {(i, lane.successor) for i, lane in first.items() if lane.successor}
            backward = {(lane.predecessor, i) for i, lane in last.items() if lane.predecessor}
            assert forward == backward
            assert all(first[i].kind is last[j].kind for i, j in forward)


def test_a_section_ends_as_wide_as_the_next_begins(network):
    for road in network.roads:
        for before, after in pairwise(road.sections):

            def reach(section, s_m: float, side: int) -> float:
                lanes = [lane for lane in section.lanes if lane.lane_id * side > 0]
                pieces = [[c for c in lane.width if c.start_m <= s_m + 1e-9][-1] for lane in lanes]
                return sum(piece.value(s_m) for piece in pieces)

            for side in (-1, 1):
                ends = reach(before, after.start_m - before.start_m, side)
                assert ends == pytest.approx(reach(after, 0.0, side), abs=1e-6)


def test_lane_numbers_have_no_gaps(network):
    for road in network.roads:
        for section in road.sections:
            ids = [lane.lane_id for lane in section.lanes]
            assert ids == sorted(ids, reverse=True)
            for side in (-1, 1):
                numbers = sorted(abs(i) for i in ids if i * side > 0)
                assert numbers == list(range(1, len(numbers) + 1))


def test_no_road_is_steeper_than_cars_and_walkers_can_bear(network):
    for road in network.roads:
        for i in range(101):
            assert abs(grade(road.heights, road.length_m * i / 100)) <= STEEPEST


def test_driving_paths_are_wide_and_long_enough_to_drive(network):
    for road in network.roads:
        assert road.length_m > 5.0
        for piece in road.alignment:
            if not piece.curvature_per_m:
                continue
            radius = 1 / abs(piece.curvature_per_m)
            assert radius > 8.0, f"road {road.road_id}"


def test_every_light_governs_one_approach_and_stands_once(network):
    signals = Counter(s.signal_id for road in network.roads for s in road.signals if s.is_light)
    references = Counter(r.signal_id for road in network.roads for r in road.references)
    controlled = Counter(c.signal_id for j in network.junctions for c in j.controllers)
    assert signals == references == controlled
    assert set(signals.values()) == {1}


def test_numbers_are_unique(network):
    roads = [road.road_id for road in network.roads]
    junctions = [junction.junction_id for junction in network.junctions]
    signs = [signal.signal_id for road in network.roads for signal in road.signals]
    assert len(set(roads) | set(junctions)) == len(roads) + len(junctions)
    assert len(set(signs)) == len(signs)


def test_equal_plans_give_equal_text():
    for plan in PLANS.values():
        assert opendrive_of(dataclasses.replace(plan)) == opendrive_of(plan)


def test_signals_come_before_references_as_the_schema_wants(network):
    root = etree.fromstring(write_opendrive(network).encode())
    for signals in root.iterfind("road/signals"):
        tags = [node.tag for node in signals]
        assert tags == sorted(tags)


def test_a_street_that_would_end_nowhere_is_refused():
    street = Street(((-80.0, 0.0), (0.0, 0.0)), StreetProfile(lanes=1, speed_limit_kmh=50))
    with pytest.raises(ValueError, match="junction 1000: lane 1 of road 1 leads nowhere"):
        build_network(TownPlan("Blind", 0.0, 0.0, (street,)))


def test_a_lane_without_a_turn_of_its_own_is_refused():
    narrow, wide = (StreetProfile(lanes=n, speed_limit_kmh=50) for n in (1, 2))
    west, east = (-80.0, 0.0), (80.0, 0.0)
    streets = (
        Street((west, (0.0, 0.0)), wide),
        Street(((0.0, 0.0), east), narrow),
        Street((east, (160.0, 0.0), (160.0, 120.0), (-160.0, 120.0), (-160.0, 0.0), west), wide),
    )
    with pytest.raises(ValueError, match="lane 1 of road 1 leads nowhere"):
        build_network(TownPlan("Narrowing", 0.0, 0.0, streets))


@pytest.mark.parametrize("name", ["Stage02", "Stage03"])
def test_paths_through_junctions_are_no_faster_than_their_curves_allow(name):
    """The client's Traffic Manager would swing into the lane beside."""
    for road in build_network(PLANS[name]).roads:
        for piece in road.alignment if road.junction_id != -1 else ():
            if piece.curvature_per_m:
                sideways = (road.speed_limit_kmh / 3.6) ** 2 * abs(piece.curvature_per_m)
                assert sideways < 6.0, f"road {road.road_id}"


def test_the_documentation_counts_what_the_towns_have(network):
    text = (Path(__file__).parents[4] / "docs" / "simulator-towns.md").read_text()
    (row,) = re.findall(rf"^\| `{network.name}` \| [^`|]+\|.*$", text, flags=re.MULTILINE)
    cells = [cell.strip() for cell in row.split("|")[3:-1]]
    lane_m = 0.0
    for road in network.roads:
        ends = [section.start_m for section in road.sections[1:]] + [road.length_m]
        for section, end in zip(road.sections, ends, strict=True):
            driving = sum(lane.kind is LaneKind.DRIVING for lane in section.lanes)
            lane_m += 0.0 if road.junction_id != -1 else driving * (end - section.start_m)
    signalised = [junction for junction in network.junctions if junction.controllers]
    heights = [height_m(r.heights, r.length_m * k / 20) for r in network.roads for k in range(21)]
    relief = max(heights) - min(heights)
    assert cells == [
        f"{lane_m / 1000:.1f} km",
        str(len(network.junctions)),
        str(len(signalised)),
        str(sum(len(junction.controllers) for junction in signalised)),
        f"{relief:.1f} m" if relief else "level",
    ]


def test_stage02_has_what_a_hilly_town_has():
    network = build_network(PLANS["Stage02"])
    kinds = {lane.kind for r in network.roads for s in r.sections for lane in s.lanes}
    assert {LaneKind.PARKING, LaneKind.BIKING, LaneKind.SIDEWALK} <= kinds
    assert 25 <= len(network.junctions) <= 40
    assert {r.speed_limit_kmh for r in network.roads if r.junction_id == -1} == {30, 40, 50, 60}
    signs = Counter(s.type_code for road in network.roads for s in road.signals)
    assert signs["206"] >= 5
    assert signs["205"] >= 5
    heights = [height_m(road.heights, 0.0) for road in network.roads]
    assert max(heights) - min(heights) > 9.0
    # Streets curve, too, not only the paths through junctions.
    assert sum(any(p.curvature_per_m for p in r.alignment) for r in network.roads[:48]) >= 8


def test_stage03_bridges_its_motorway():
    network = build_network(PLANS["Stage03"])
    streets = [road for road in network.roads if road.junction_id == -1]
    motorway = [r for r in streets if r.kind == "motorway" and r.speed_limit_kmh == 100]
    lanes = Counter(
        sum(lane.kind is LaneKind.DRIVING for lane in road.sections[0].lanes) for road in motorway
    )
    assert set(lanes) == {3, 4}  # with and without a lane to speed up or slow down
    assert {height_m(road.heights, 0.0) for road in motorway} == {0.0}
    ramps = [road for road in streets if road.kind == "motorway" and road not in motorway]
    assert len(ramps) == 8
    for ramp in ramps:
        ends = sorted(height_m(ramp.heights, s) for s in (0.0, ramp.length_m))
        assert ends == pytest.approx([0.0, 6.2])
