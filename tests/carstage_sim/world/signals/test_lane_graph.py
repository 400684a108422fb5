"""Lanes go on across the ends of roads: what leads to a place is found upstream of short roads."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.maps.town import LaneSamples
from carstage_sim.world.signals.lane_graph import LaneGraph


def street(*lengths_m: int, lane_id: int = -1) -> LaneSamples:
    """Roads one after the other along x, each of one lane; one against its road runs down its s."""
    x = np.concatenate(
        [
            sum(lengths_m[:road]) + np.arange(length, dtype=np.float64)
            for road, length in enumerate(lengths_m)
        ]
    )
    road_id = np.repeat(np.arange(len(lengths_m), dtype=np.int32), lengths_m)
    s_m = x - np.array([sum(lengths_m[:road]) for road in road_id])
    count = len(x)
    return LaneSamples(
        location=np.stack([x, np.zeros(count), np.zeros(count)], axis=1),
        rotation_deg=np.zeros((count, 3)),
        width_m=np.full(count, 3.5, np.float32),
        speed_limit_kmh=np.full(count, 30.0, np.float32),
        posted_kmh=np.zeros(count, np.float32),
        road_id=road_id,
        section_id=np.zeros(count, np.int32),
        lane_id=np.full(count, lane_id, np.int32),
        s_m=s_m if lane_id < 0 else np.array(lengths_m)[road_id] - s_m,
        junction_id=np.full(count, -1, np.int32),
    )


@pytest.mark.parametrize("lane_id", [-1, 1])
def test_what_leads_to_a_place_is_found_across_the_ends_of_roads(lane_id: int) -> None:
    lanes = street(80, 2, 3, lane_id=lane_id)
    samples, before_m = LaneGraph(lanes).before(83, 40.0, 1.0)
    found = dict(zip(samples.tolist(), before_m.tolist(), strict=True))
    assert found == {row: pytest.approx(83.0 - row) for row in range(43, 85)}


def test_the_way_ends_where_a_junction_begins() -> None:
    lanes = street(30, 10, 20)
    lanes.junction_id[30:40] = 4
    samples, _ = LaneGraph(lanes).before(59, 100.0)
    assert sorted(samples.tolist()) == list(range(40, 60))


def test_a_lane_in_the_other_direction_leads_nowhere_here() -> None:
    lanes = street(30, 20)
    lanes.rotation_deg[:30, 1] = 180.0
    samples, _ = LaneGraph(lanes).before(49, 100.0)
    assert sorted(samples.tolist()) == list(range(30, 50))


def test_a_ring_is_walked_once() -> None:
    angle = np.radians(np.arange(0.0, 360.0, 2.0))
    lanes = street(180)
    lanes.location[:, 0], lanes.location[:, 1] = 30.0 * np.cos(angle), 30.0 * np.sin(angle)
    lanes.rotation_deg[:, 1] = np.degrees(angle) + 90.0
    samples, before_m = LaneGraph(lanes).before(50, 1000.0)
    assert len(set(samples.tolist())) == len(samples) == 180
    assert before_m.min() == 0.0
