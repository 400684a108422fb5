"""The signal cycle, as drivers at a junction need it."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.maps.town import OrientedBox, TrafficLightSite
from carstage_sim.world.traffic_lights import TrafficLightState, TrafficLightSystem

RED, YELLOW, GREEN = TrafficLightState.RED, TrafficLightState.YELLOW, TrafficLightState.GREEN


def site(sign_id: str, junction_id: int, phase: int, yaw_deg: float = 0.0) -> TrafficLightSite:
    x = 100.0 * junction_id + 10.0 * int(sign_id)
    return TrafficLightSite(
        sign_id=sign_id,
        location=(x, 0.0, 0.0),
        rotation_deg=(0.0, yaw_deg, 0.0),
        head=(0.0, 0.0, 5.0, 0.0),
        junction_id=junction_id,
        phase=phase,
        trigger=(OrientedBox((x, 3.0, 1.0), (4.0, 1.5, 2.0), (0.0, yaw_deg, 0.0)),),
    )


@pytest.fixture
def lights() -> TrafficLightSystem:
    """Junction 1: lights 0 and 2 in phase 0, light 1 in phase 1; junction 2: light 3 alone."""
    return TrafficLightSystem([site("0", 1, 0), site("1", 1, 1), site("2", 1, 0), site("3", 2, 0)])


def run(lights: TrafficLightSystem, seconds: float, delta_s: float = 0.05) -> None:
    for _ in range(round(seconds / delta_s)):
        lights.step(delta_s)


def test_a_cycle_is_green_yellow_all_red_then_the_next_phase(lights: TrafficLightSystem) -> None:
    seen = [tuple(lights.state[:3].tolist())]
    for _ in range(round(30.0 / 0.05)):
        lights.step(0.05)
        state = tuple(lights.state[:3].tolist())
        if state != seen[-1]:
            seen.append(state)
    assert seen == [
        (GREEN, RED, GREEN),
        (YELLOW, RED, YELLOW),
        (RED, RED, RED),
        (RED, GREEN, RED),
        (RED, YELLOW, RED),
        (RED, RED, RED),
        (GREEN, RED, GREEN),
    ]


def test_states_change_on_the_exact_tick(lights: TrafficLightSystem) -> None:
    run(lights, 9.95)
    assert lights.state[0] == GREEN
    lights.step(0.05)
    assert lights.state[0] == YELLOW
    assert lights.elapsed_s[0] == pytest.approx(0.0, abs=1e-6)
    run(lights, 3.0)
    assert lights.state[0] == RED


def test_conflicting_phases_are_never_open_together(lights: TrafficLightSystem) -> None:
    for _ in range(2000):
        lights.step(0.037)
        open_now = lights.state != RED
        assert not (open_now[0] and open_now[1])


def test_elapsed_time_counts_from_each_lights_own_change(lights: TrafficLightSystem) -> None:
    run(lights, 12.0)
    assert lights.elapsed_s[0] == pytest.approx(2.0)
    assert lights.elapsed_s[1] == pytest.approx(12.0)


def test_times_hold_for_the_whole_phase(lights: TrafficLightSystem) -> None:
    lights.set_times(2, green=4.0)
    assert lights.green_s.tolist() == [4.0, 10.0, 4.0, 10.0]
    run(lights, 4.0)
    assert lights.state[0] == YELLOW
    with pytest.raises(ValueError, match="cannot last"):
        lights.set_times(0, red=-1.0)


def test_freezing_stops_the_cycle_and_its_clock(lights: TrafficLightSystem) -> None:
    run(lights, 1.0)
    lights.freeze_all(True)
    run(lights, 60.0)
    assert lights.state[0] == GREEN
    assert lights.elapsed_s[0] == pytest.approx(1.0)
    lights.freeze_all(False)
    lights.freeze(3, True)
    run(lights, 9.0)
    assert lights.state[[0, 3]].tolist() == [YELLOW, GREEN]


def test_a_forced_state_lasts_until_the_cycle_moves_on(lights: TrafficLightSystem) -> None:
    lights.set_state(0, GREEN)
    lights.set_state(1, TrafficLightState.OFF)
    run(lights, 14.0)
    assert lights.state[1] == TrafficLightState.OFF
    run(lights, 1.0)
    assert lights.state[1] == GREEN


def test_reset_starts_one_junction_or_all_over(lights: TrafficLightSystem) -> None:
    run(lights, 16.0)
    lights.reset_group(1)
    assert lights.state[:3].tolist() == [GREEN, RED, GREEN]
    assert lights.elapsed_s[3] > 0.0
    lights.reset_all()
    assert lights.elapsed_s.tolist() == [0.0] * 4


def test_group_is_the_junction(lights: TrafficLightSystem) -> None:
    assert lights.group(1) == [0, 1, 2]
    assert lights.group(3) == [3]


def test_lights_at_finds_the_trigger_volume_in_its_own_axes() -> None:
    lights = TrafficLightSystem([site("1", 0, 0), site("5", 0, 1, yaw_deg=90.0)])
    places = np.array(
        [
            [10.0, 3.0, 0.5],  # middle of the first
            [13.9, 4.4, 0.5],  # near its corner
            [14.1, 3.0, 0.5],  # past its end
            [50.0, 6.9, 0.5],  # the second is turned: long across
            [53.9, 3.0, 0.5],
            [10.0, 3.0, 9.0],  # above
        ]
    )
    assert lights.lights_at(places).tolist() == [0, 0, -1, 1, -1, -1]


def test_a_map_without_lights_has_none() -> None:
    lights = TrafficLightSystem([])
    lights.step(0.05)
    assert lights.lights_at(np.zeros((3, 3))).tolist() == [-1, -1, -1]
    assert len(lights) == 0
