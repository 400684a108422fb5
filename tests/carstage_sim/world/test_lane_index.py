"""The nearest lane of a place: of roads above each other the one at its height."""

from __future__ import annotations

import numpy as np

from carstage_sim.maps.town import LaneSamples
from carstage_sim.world.lane_index import LaneIndex

_LENGTH_M = 60
_BRIDGE_M = 6.0


def crossing_roads(height_m: float) -> LaneSamples:
    """A road along x for 30 km/h, and one along y for 90 km/h at some height above it."""
    along = np.arange(-_LENGTH_M, _LENGTH_M + 1, dtype=np.float64)
    zero, count = np.zeros_like(along), len(along)
    low = np.stack([along, zero, zero], axis=1)
    high = np.stack([zero, along + 0.3, zero + height_m], axis=1)
    return LaneSamples(
        location=np.concatenate([low, high]),
        rotation_deg=np.repeat([[0.0, 0.0, 0.0], [0.0, 90.0, 0.0]], count, axis=0),
        width_m=np.full(2 * count, 3.5, np.float32),
        speed_limit_kmh=np.repeat(np.array([30.0, 90.0], np.float32), count),
        posted_kmh=np.zeros(2 * count, np.float32),
        road_id=np.repeat(np.array([1, 2], np.int32), count),
        section_id=np.zeros(2 * count, np.int32),
        lane_id=np.full(2 * count, -1, np.int32),
        s_m=np.tile(along + _LENGTH_M, 2),
        junction_id=np.full(2 * count, -1, np.int32),
    )


def roads_at(lanes: LaneSamples, places: np.ndarray) -> list[int]:
    return lanes.road_id[LaneIndex(lanes).nearest(places)].tolist()


def test_the_lane_on_and_under_a_bridge_is_that_of_the_vehicles_own_road() -> None:
    lanes = crossing_roads(_BRIDGE_M)
    index = LaneIndex(lanes)
    places = np.array([[x, y, z] for x in (-1.0, 0.2, 1.4) for y in (0.0, 1.1) for z in (0.0, 6.4)])
    expected = np.where(places[:, 2] > 3.0, 2, 1)
    for _ in range(2):  # also when the cells are known
        assert lanes.road_id[index.nearest(places)].tolist() == expected.tolist()


def test_roads_that_meet_at_one_height_are_told_apart_by_nearness_alone() -> None:
    places = np.array([[20.4, 0.4, 0.0], [0.4, 20.4, 0.0], [20.4, 0.4, 9.0]])
    assert roads_at(crossing_roads(0.0), places) == [1, 2, 1]


def test_a_place_far_from_all_roads_finds_the_nearest() -> None:
    assert roads_at(crossing_roads(_BRIDGE_M), np.array([[40.0, 25.0, 0.0]])) == [1]


def test_who_is_parked_at_the_kerb_is_on_no_lane_and_who_changes_lanes_is() -> None:
    index = LaneIndex(crossing_roads(_BRIDGE_M))
    places = np.array([[30.0, aside, 0.0] for aside in (0.0, 1.75, 2.6, 3.2, 6.0)])
    on_lane = index.is_on_lane(places, index.nearest(places))
    assert on_lane.tolist() == [True, True, True, False, False]
