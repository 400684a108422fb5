"""A stop counts unless a red light heads the queue."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.simulator.traffic.recording import GREEN, NO_LIGHT, RED, YELLOW
from benchmarks.simulator.traffic.standing import longest_stand_s
from traffic_recordings import DELTA_S, recording

TICKS = 100


def test_a_vehicle_that_stands_alone_is_stuck() -> None:
    moving = np.arange(TICKS) * 2.0 + 50.0
    stood = longest_stand_s(recording(np.stack([np.zeros(TICKS), moving], axis=1)))
    assert stood.tolist() == [TICKS * DELTA_S, DELTA_S]  # the first tick has no speed yet


@pytest.mark.parametrize(("state", "waits"), [(RED, True), (YELLOW, True), (GREEN, False)])
def test_a_queue_behind_a_red_light_is_no_jam(state: int, waits: bool) -> None:
    # The first is at the light, two queue up behind it, the last stands far behind.
    x = np.tile([100.0, 93.0, 84.0, 40.0], (TICKS, 1))
    light = np.tile([state, NO_LIGHT, NO_LIGHT, NO_LIGHT], (TICKS, 1))
    whole = TICKS * DELTA_S
    expected = [0.0, 0.0, 0.0, whole] if waits else [whole] * 4
    assert longest_stand_s(recording(x, light_state=light)).tolist() == expected


def test_the_part_of_a_stop_under_green_counts_across_red_phases() -> None:
    light = np.full((TICKS, 1), GREEN)
    light[20:40] = RED
    stood = longest_stand_s(recording(np.zeros((TICKS, 1)), light_state=light))
    assert stood.tolist() == [(TICKS - 20) * DELTA_S]


def test_standing_ends_when_the_vehicle_moves() -> None:
    x = np.zeros((TICKS, 1))
    x[60:] = 5.0
    assert longest_stand_s(recording(x)).tolist() == [60 * DELTA_S]


def test_a_vehicle_that_is_gone_does_not_stand() -> None:
    x = np.zeros((TICKS, 2))
    x[40:, 0] = np.nan
    assert longest_stand_s(recording(x)).tolist() == [40 * DELTA_S, TICKS * DELTA_S]
