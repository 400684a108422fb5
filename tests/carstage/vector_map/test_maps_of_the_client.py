"""Vector maps beside what CARLA's own client makes of the same OpenDRIVE texts.

Two things the client does otherwise on purpose are left out of the towns here, or allowed for: it
shifts crosswalks by the lane offset of their road, and lights by 0.25 m.
"""

from __future__ import annotations

import gzip
from collections import defaultdict
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import carla
import numpy as np
import pytest

from carstage.vector_map import Lane, VectorMap, vector_map
from carstage_sim.maps.writer import PLANS, opendrive_of

pytestmark = pytest.mark.xdist_group("vector maps")  # each town is read once

TOWNS = (*PLANS, "Town07", "Town10HD")
STEP_M = 8.0
MARKS = {
    "other": "Other", "broken": "Broken", "solid": "Solid", "solid solid": "SolidSolid",
    "solid broken": "SolidBroken", "broken solid": "BrokenSolid",
    "broken broken": "BrokenBroken", "botts dots": "BottsDots", "grass": "Grass", "curb": "Curb",
}  # fmt: skip
COLOURS = {"Standard": "white"}  # the client's two names of it are one value
LANE_CHANGES = {"increase": "Right", "decrease": "Left", "both": "Both", "none": "NONE"}


def text_of(name: str) -> str:
    if name in PLANS:
        return opendrive_of(PLANS[name])
    spec = find_spec("py123d")
    if spec is None or not spec.submodule_search_locations:
        pytest.skip("py123d, which carries CARLA's maps, is not installed")
    folder = Path(spec.submodule_search_locations[0]) / "parser" / "opendrive" / "carla_maps"
    return gzip.decompress((folder / f"{name}.xodr.gz").read_bytes()).decode()


@dataclass(frozen=True)
class Sample:
    """A place on a lane, as the client and the map have it."""

    lane: Lane
    waypoint: Any
    s_m: float


@dataclass(frozen=True)
class Town:
    made: VectorMap
    client: carla.Map
    samples: list[Sample]


@pytest.fixture(scope="module", params=TOWNS)
def town(request: pytest.FixtureRequest) -> Town:
    text = text_of(request.param)
    made, client = vector_map(text), carla.Map(request.param, text)
    samples = []
    for lane in made.lanes:
        begin, end = lane.s_m.min(), lane.s_m.max()
        if end - begin < 0.02:
            continue
        for s_m in np.linspace(begin + 0.005, end - 0.005, max(3, int((end - begin) / STEP_M))):
            waypoint = client.get_waypoint_xodr(lane.road_id, lane.lane, float(s_m))
            assert waypoint is not None, lane.id
            assert waypoint.section_id == lane.section, lane.id
            samples.append(Sample(lane, waypoint, float(s_m)))
    return Town(made, client, samples)


def at(sample: Sample, values: np.ndarray) -> np.ndarray:
    """Values of a lane at a sample."""
    lane = sample.lane
    order = np.argsort(lane.s_m)
    columns = values.reshape(len(values), -1)[order].T
    return np.array([np.interp(sample.s_m, lane.s_m[order], column) for column in columns])


def test_lanes_are_where_the_client_has_them_and_as_wide(town: Town) -> None:
    assert len(town.samples) > 1500
    for sample in town.samples:
        lane, place = sample.lane, sample.waypoint.transform.location
        found = at(sample, lane.centre_line)
        assert np.hypot(found[0] - place.x, found[1] - place.y) < 0.02, lane.id
        # The client leaves out how high a lane lies above its road, as sidewalks do.
        raised = found[2] - place.z
        assert -0.02 < raised < 0.25, lane.id
        assert abs(raised) < 0.02 or lane.type != "driving", lane.id
        assert abs(at(sample, lane.width_m)[0] - sample.waypoint.lane_width) < 0.02, lane.id
        apart = at(sample, lane.left_boundary - lane.right_boundary)[:2]
        assert abs(np.hypot(*apart) - sample.waypoint.lane_width) < 0.03, lane.id


def test_lanes_run_as_the_client_drives_and_have_its_types(town: Town) -> None:
    for sample in town.samples:
        assert str(sample.waypoint.lane_type).lower() == sample.lane.type.lower()
        yaw = np.radians(sample.waypoint.transform.rotation.yaw)
        left, right = sample.lane.left_boundary, sample.lane.right_boundary
        across = at(sample, right - left)[:2]
        if np.hypot(*across) > 0.1:
            to_the_right = np.array([-np.sin(yaw), np.cos(yaw)])
            # The client's heading follows the lane's middle where the width changes.
            assert across @ to_the_right / np.hypot(*across) > 0.3, sample.lane.id
        assert sample.waypoint.is_junction == (sample.lane.junction_id is not None)


def test_markings_beside_a_lane_are_the_client_s(town: Town) -> None:
    seen = set()
    for sample in town.samples:
        lane, waypoint = sample.lane, sample.waypoint
        for names, expected in (
            (lane.left_markings, waypoint.left_lane_marking),
            (lane.right_markings, waypoint.right_lane_marking),
        ):
            here = [
                mark
                for mark in map(town.made.marking_by_id.__getitem__, names)
                if mark.s_m[0] <= sample.s_m < mark.s_m[1]
            ]
            if not here:
                assert str(expected.type) == "NONE", lane.id
                continue
            (mark,) = here
            seen.add(mark.type)
            assert MARKS[mark.type] == str(expected.type), mark.id
            colour = str(expected.color)
            assert mark.colour == COLOURS.get(colour, colour.lower()), mark.id
            assert mark.width_m == pytest.approx(expected.width, abs=1e-4)
            assert LANE_CHANGES[mark.lane_change] == str(expected.lane_change), mark.id
            assert lane.id in mark.lanes
    assert {"solid", "broken"} <= seen


def test_driving_lanes_lead_where_the_client_drives_on(town: Town) -> None:
    expected: dict[str, set[str]] = defaultdict(set)
    for begin, end in town.client.get_topology():
        expected[name_of(begin)].add(name_of(end))
    found = {
        lane.id: set(lane.successors)
        for lane in town.made.lanes
        if lane.type == "driving" and lane.successors
    }
    assert found == expected
    for lane in town.made.lanes:
        for other in lane.successors:
            following = town.made.lane_by_id[other]
            gap = lane.centre_line[-1] - following.centre_line[0]
            assert lane.id in following.predecessors
            if lane.type == "driving":
                assert np.hypot(*gap[:2]) < 0.5, (lane.id, other)


def name_of(waypoint: carla.Waypoint) -> str:
    return f"{waypoint.road_id}/{waypoint.section_id}/{waypoint.lane_id}"


def test_crosswalks_are_the_client_s(town: Town) -> None:
    rings: list[list[tuple[float, float, float]]] = [[]]
    for corner in town.client.get_crosswalks():
        rings[-1].append((corner.x, corner.y, corner.z))
        if len(rings[-1]) > 2 and rings[-1][0] == rings[-1][-1]:
            rings.append([])
    expected = [np.array(ring) for ring in rings[:-1]]
    assert len(town.made.crosswalks) == len(expected) > 0
    for walk in town.made.crosswalks:
        same = [ring for ring in expected if ring.shape == walk.outline.shape]
        apart = [np.abs(ring - walk.outline).max(axis=0) for ring in same]
        # The client leaves out their height above the road, a centimetre.
        assert any((one < (0.01, 0.01, 0.05)).all() for one in apart), walk.id


def test_signals_are_the_client_s_landmarks(town: Town) -> None:
    landmarks = defaultdict(list)
    for landmark in town.client.get_all_landmarks():
        landmarks[landmark.id].append(landmark)
    assert {signal.id for signal in town.made.signals} == set(landmarks)
    driving = {(lane.road_id, lane.lane) for lane in town.made.lanes if lane.type == "driving"}
    apart = []
    for signal in town.made.signals:
        first = landmarks[signal.id][0]
        assert signal.type == first.type, signal.id
        place = first.transform.location
        apart.append(np.hypot(signal.place[0] - place.x, signal.place[1] - place.y))
        if signal.name.lower().startswith("speed_"):
            continue  # an object: the client takes its orientation for that of a signal
        expected = {
            (one.road_id, lane)
            for one in landmarks[signal.id]
            for begin, end in one.get_lane_validities()
            for lane in range(min(begin, end), max(begin, end) + 1)
        }
        lanes = (town.made.lane_by_id[lane] for lane in signal.lanes)
        found = {(lane.road_id, lane.lane) for lane in lanes}
        assert found & driving == expected & driving, signal.id
    # The client moves lights by 0.25 m, and what stands on a lane beside it.
    assert np.mean(np.array(apart) < 0.26) > 0.9
    assert np.median(apart) < 0.26


def test_every_light_that_stops_a_lane_has_its_line_across_it(town: Town) -> None:
    lines = [line for line in town.made.stop_lines if line.source == "signal"]
    stopped = {signal for line in lines for signal in line.signals}
    for signal in town.made.signals:
        if signal.type == "1000001" and signal.lanes:
            assert signal.id in stopped, signal.id
    for line in lines:
        (name,) = line.lanes
        lane = town.made.lane_by_id[name]
        length = np.hypot(*(line.line[1] - line.line[0])[:2])
        assert lane.width_m.min() - 0.05 < length < lane.width_m.max() + 0.05
