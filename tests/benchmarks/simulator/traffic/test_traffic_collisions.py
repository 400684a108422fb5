"""Distinct pairs per five seconds; buildings that vehicles are in."""

from __future__ import annotations

import numpy as np

from benchmarks.simulator.traffic.collisions import collision_pairs, inside_buildings, walkers_hit
from benchmarks.simulator.traffic.recording import Partner
from traffic_recordings import collisions, recording

STILL = np.zeros((60, 2)) + np.array([0.0, 50.0])


def test_both_sides_and_all_ticks_of_a_touch_count_once_in_five_seconds() -> None:
    # A window is ten ticks of half a second.
    reports = [(3, 10, 11, 0), (3, 11, 10, 0), (4, 10, 11, 0), (12, 11, 10, 0), (14, 10, 11, 0)]
    found = collision_pairs(recording(STILL, **collisions(*reports)), Partner.VEHICLE)
    assert found == [(3, 10, 11), (14, 10, 11)]


def test_kinds_are_counted_apart() -> None:
    touched = recording(STILL, **collisions((1, 10, 0, 2), (2, 10, 99, 1)))
    assert [len(collision_pairs(touched, kind)) for kind in Partner] == [0, 1, 1]


def test_only_a_moving_vehicle_hits_a_walker() -> None:
    x = np.stack([np.arange(20) * 2.0, np.full(20, 100.0)], axis=1)
    walkers = np.full((20, 3, 3), 0.0)
    walkers[:, 0] = (20.0, 1.1, 1.0)  # at the side of the moving one, within arm's reach
    walkers[:, 1] = (20.0, 1.9, 1.0)
    walkers[:, 2] = (101.0, 0.0, 1.0)
    found = walkers_hit(recording(x, walker_location=walkers))
    # At 4 m/s it takes 1.3 s to pass by, in ticks of half a second.
    assert [(vehicle, walker) for _, vehicle, walker in found] == [(0, 0)]


def test_a_vehicle_inside_a_building_is_found_once() -> None:
    building = {
        "building_center": np.array([[51.0, 0.0, 5.0], [0.0, 20.0, 5.0]]),
        "building_extent": np.array([[4.0, 4.0, 5.0], [4.0, 4.0, 5.0]]),
        "building_yaw_deg": np.array([30.0, 0.0]),
    }
    assert inside_buildings(recording(STILL, **building)) == [(0, 1)]
