"""The state of a light counts when the front bumper crosses, or when the vehicle sets off again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benchmarks.simulator.traffic.passages import passages, red_lights_run
from benchmarks.simulator.traffic.recording import GREEN, RED, YELLOW
from traffic_recordings import recording


def one_light(ticks: int, states: list[int]) -> dict[str, Any]:
    """A stop line at x = 10 across the lane."""
    return {
        "signal_id": np.array([5]),
        "signal_state": np.array(states, np.uint8).reshape(ticks, 1),
        "stop_signal": np.array([0]),
        "stop_pose": np.array([[10.0, 0.0, 0.0, 0.0]]),
        "stop_width_m": np.array([3.5]),
    }


def test_a_passage_takes_the_state_at_which_the_bumper_crossed() -> None:
    # Bumpers are 2.4 m ahead: the line at 10 m is entered at the third tick.
    x = np.array([[5.0], [7.0], [9.0], [11.0], [13.0]])
    found = passages(recording(x, **one_light(5, [GREEN, GREEN, YELLOW, RED, RED])))
    assert [(p.tick, p.entered, p.state) for p in found] == [(3, 2, YELLOW)]


def test_red_when_the_bumper_crosses_is_a_red_light_run() -> None:
    x = np.array([[5.0], [7.0], [9.0], [11.0]])
    driven = passages(recording(x, **one_light(4, [GREEN, GREEN, RED, RED])))
    assert len(red_lights_run(driven)) == 1


@pytest.mark.parametrize(("sets_off_under", "run"), [(RED, 1), (GREEN, 0)])
def test_who_stopped_with_the_nose_over_the_line_counts_when_setting_off(
    sets_off_under: int, run: int
) -> None:
    x = np.array([[6.0], [8.0], [8.0], [8.0], [9.0], [10.5]])
    states = [GREEN, YELLOW, RED, sets_off_under, sets_off_under, RED]
    assert len(red_lights_run(passages(recording(x, **one_light(6, states))))) == run


def test_a_vehicle_on_another_lane_or_going_the_other_way_does_not_pass() -> None:
    x = np.array([[8.0, 12.0], [12.0, 8.0]])
    aside = recording(x, **one_light(2, [RED, RED]))
    aside.location[:, 0, 1] = 3.0
    aside.yaw_deg[:, 1] = 180.0
    assert passages(aside) == []


def test_stopping_short_of_the_line_is_no_passage() -> None:
    x = np.array([[5.0], [7.0], [9.0], [9.0]])
    assert passages(recording(x, **one_light(4, [RED] * 4))) == []
