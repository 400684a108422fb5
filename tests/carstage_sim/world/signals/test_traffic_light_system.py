"""The signal cycle, as drivers at a junction need it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.maps.town import OrientedBox, TrafficLightSite
from carstage_sim.world.signals.traffic_lights import (
    GAP_S,
    LEAST_GREEN_S,
    LONGEST_WAIT_S,
    OUTNUMBERED,
    Queues,
    TrafficLightState,
    TrafficLightSystem,
)

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


SITES = [site("0", 1, 0), site("1", 1, 1), site("2", 1, 0), site("3", 2, 0)]
"""Junction 1: lights 0 and 2 in phase 0, light 1 in phase 1; junction 2: light 3 alone."""


@pytest.fixture
def lights() -> TrafficLightSystem:
    return TrafficLightSystem(SITES)


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


def test_elapsed_time_counts_for_the_phase_whose_turn_it_is(lights: TrafficLightSystem) -> None:
    run(lights, 12.0)
    assert lights.elapsed_s[:2].tolist() == pytest.approx([2.0, 0.0])
    lights.set_state(0, GREEN)
    run(lights, 2.0)
    assert lights.elapsed_s[:2].tolist() == pytest.approx([1.0, 0.0])
    run(lights, 2.0)
    assert lights.elapsed_s[:3].tolist() == pytest.approx([0.0, 1.0, 0.0])


@pytest.mark.parametrize("waited_s", [0.0, 20.0])
def test_a_replay_that_ends_while_all_are_red_goes_on_with_the_phase_after(
    lights: TrafficLightSystem, waited_s: float
) -> None:
    """In older logs the clocks of phases that wait run, too."""
    run(lights, 29.0)
    after = TrafficLightSystem(SITES)
    for index, state in enumerate(lights.state.tolist()):
        after.show(index, state, float(lights.elapsed_s[index]) or waited_s)
    after.adopt_states()
    for _ in range(200):
        lights.step(0.05)
        after.step(0.05)
        assert after.state.tolist() == lights.state.tolist()


def run_with(
    lights: TrafficLightSystem, seconds: float, queues: dict[int, int], *, is_clear: bool = False
) -> None:
    """Lets time pass with so many vehicles before the lights."""
    count = np.array([queues.get(light, 0) for light in range(len(lights))])
    beyond = np.full(len(lights), not is_clear)
    for _ in range(round(seconds / 0.05)):
        lights.step(0.05, Queues(count, count > 0, beyond))


def test_a_green_that_nobody_uses_ends_early_when_somebody_waits(
    lights: TrafficLightSystem,
) -> None:
    run_with(lights, LEAST_GREEN_S - 0.05, {1: 1})
    assert lights.state[0] == GREEN
    run_with(lights, 0.05, {1: 1})
    assert lights.state[0] == YELLOW
    run_with(lights, 5.0, {1: 1})
    assert lights.state[:3].tolist() == [RED, GREEN, RED]


def test_a_used_green_lasts_until_others_have_waited_long(lights: TrafficLightSystem) -> None:
    run_with(lights, 20.0, {0: 1})
    run_with(lights, LONGEST_WAIT_S - 0.05, {0: 2, 1: 4})
    assert lights.state[0] == GREEN
    run_with(lights, 0.05, {0: 2, 1: 4})
    assert lights.state[0] == YELLOW
    run_with(lights, 2.95, {0: 2, 1: 4})
    assert lights.state[0] == YELLOW


def test_a_green_ends_when_the_queue_elsewhere_is_much_longer(lights: TrafficLightSystem) -> None:
    run_with(lights, 20.0, {0: 1, 2: 1, 1: 2 * OUTNUMBERED - 1})
    assert lights.state[0] == GREEN
    run_with(lights, 0.05, {0: 1, 2: 1, 1: 2 * OUTNUMBERED})
    assert lights.state[0] == YELLOW


def test_a_gap_in_the_queue_shorter_than_its_limit_does_not_end_a_green(
    lights: TrafficLightSystem,
) -> None:
    run_with(lights, 5.0, {0: 1, 1: 1})
    run_with(lights, GAP_S - 0.05, {1: 1})
    run_with(lights, 1.0, {0: 1, 1: 1})
    assert lights.state[0] == GREEN


def test_a_green_stays_while_nobody_waits_elsewhere_and_ends_when_only_others_are_left(
    lights: TrafficLightSystem,
) -> None:
    run_with(lights, 3 * LONGEST_WAIT_S, {0: 1})
    assert lights.state[0] == GREEN
    run_with(lights, GAP_S, {1: 1})
    assert lights.state[0] == YELLOW


def test_phases_that_nobody_waits_for_are_left_out() -> None:
    lights = TrafficLightSystem([site(str(n), 1, n) for n in range(3)])
    run_with(lights, LONGEST_WAIT_S + 5.0, {0: 1, 2: 1})
    assert lights.state.tolist() == [RED, RED, GREEN]


def test_the_clearing_time_ends_when_nobody_is_left_on_the_junction(
    lights: TrafficLightSystem,
) -> None:
    run_with(lights, LEAST_GREEN_S + 2.95, {1: 1}, is_clear=True)
    assert lights.state[:2].tolist() == [YELLOW, RED]
    run_with(lights, 0.5, {1: 1})
    assert lights.state[:2].tolist() == [RED, RED]
    run_with(lights, 0.05, {1: 1}, is_clear=True)
    assert lights.state[:2].tolist() == [RED, GREEN]


def test_the_longest_queue_is_next_unless_somebody_has_waited_long() -> None:
    lights = TrafficLightSystem([site(str(n), 1, n) for n in range(3)])
    run_with(lights, LEAST_GREEN_S + 5.0, {1: 1, 2: 2})
    assert lights.state.tolist() == [RED, RED, GREEN]
    run_with(lights, LONGEST_WAIT_S - 2.0, {0: 2, 1: 1, 2: 2})
    assert lights.state.tolist() == [RED, GREEN, RED]


def test_once_a_client_set_a_light_the_junctions_cycle_has_fixed_lengths(
    lights: TrafficLightSystem,
) -> None:
    lights.set_times(0, green=10.0)
    run_with(lights, 9.95, {1: 1})
    assert lights.state[0] == GREEN


def test_a_light_alone_keeps_its_cycle(lights: TrafficLightSystem) -> None:
    run_with(lights, 10.0, {3: 1})
    assert lights.state[3] == YELLOW


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


CAR_HALF_SIZE = np.array([2.0, 1.0])


def lights_of(system: TrafficLightSystem, *cars: tuple[float, float, float, float]) -> list[int]:
    """The light of cars at x, y, z with a yaw (deg)."""
    places = np.array(cars)
    half_size = np.tile(CAR_HALF_SIZE, (len(cars), 1))
    return system.lights_at(places[:, :3], half_size, np.radians(places[:, 3])).tolist()


def test_a_vehicle_is_at_a_light_from_its_bumper_s_entry_to_its_rear_s_exit() -> None:
    # The volume reaches from 6 to 14 m along x and from 1.5 to 4.5 m across.
    lights = TrafficLightSystem([site("1", 0, 0)])
    along = [lights_of(lights, (x, 3.0, 0.0, 0.0))[0] for x in (3.9, 4.1, 10.0, 15.9, 16.1)]
    assert along == [-1, 0, 0, 0, -1]
    across = [lights_of(lights, (10.0, y, 0.0, 0.0))[0] for y in (0.4, 0.6, 5.4, 5.6)]
    assert across == [-1, 0, 0, -1]
    assert lights_of(lights, (10.0, 3.0, 9.0, 0.0)) == [-1]  # on a bridge above


def test_volumes_and_vehicles_may_be_turned() -> None:
    lights = TrafficLightSystem([site("5", 0, 1, yaw_deg=90.0)])
    # Long across: x from 48.5 to 51.5, y from -1 to 7.
    assert lights_of(lights, (50.0, 8.9, 0.0, 90.0), (50.0, 8.9, 0.0, 0.0)) == [0, -1]
    # A box around the turned body would reach in, the body does not.
    assert lights_of(lights, (53.0, -2.0, 0.0, 45.0), (52.0, -1.0, 0.0, 45.0)) == [-1, 0]


def test_between_two_lights_the_one_ahead_governs() -> None:
    near, far = site("1", 0, 0), replace(site("2", 1, 0), trigger=(moved(site("1", 0, 0), 8.5),))
    for order in ([near, far], [far, near]):
        lights = TrafficLightSystem(order)
        assert lights_of(lights, (14.3, 3.0, 0.0, 0.0)) == [order.index(far)]
        assert lights_of(lights, (14.3, 3.0, 0.0, 180.0)) == [order.index(near)]


def moved(of: TrafficLightSite, x_m: float) -> OrientedBox:
    box = of.trigger[0]
    return replace(box, center=(box.center[0] + x_m, *box.center[1:]))


def test_a_map_without_lights_has_none() -> None:
    lights = TrafficLightSystem([])
    lights.step(0.05)
    assert lights_of(lights, (0, 0, 0, 0), (9, 0, 0, 0)) == [-1, -1]
    assert len(lights) == 0
