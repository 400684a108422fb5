"""Which lights are green together."""

from __future__ import annotations

from carstage_sim.maps.lights import light_sites
from carstage_sim.maps.signals import LIGHT, Controller, GovernedLane, Signal, SignalPlan


def light(signal_id: str, yaw_deg: float) -> Signal:
    place = (0.0, 0.0, 0.0)
    lane = GovernedLane(1, -1, 9, 3.5, place, yaw_deg, place, yaw_deg, place, yaw_deg)
    return Signal(signal_id, LIGHT, -1.0, place, yaw_deg, (lane,))


def phases(signals: list[Signal], *controllers: tuple[str, ...]) -> dict[str, tuple[int, int]]:
    plan = SignalPlan(
        (0.0, 0.0), tuple(signals), tuple(Controller(9, names) for names in controllers), {}
    )
    sites = light_sites(plan, lambda _x, _y: 0.0)
    return {site.sign_id: (site.junction_id, site.phase) for site in sites}


def test_the_signals_of_a_controller_share_a_phase_and_controllers_take_turns():
    found = phases([light("a", 0.0), light("b", 180.0), light("c", 90.0)], ("a", "b"), ("c",))
    assert found == {"a": (9, 0), "b": (9, 0), "c": (9, 1)}


def test_a_signal_of_two_controllers_belongs_to_the_one_with_the_fewest_signals():
    found = phases([light("a", 0.0), light("b", 90.0)], ("a", "b", "a"), ("b", "b"))
    assert found == {"a": (9, 0), "b": (9, 1)}


def test_lights_without_a_controller_take_turns_by_approach_after_the_others():
    signals = [light("a", 0.0), light("b", 90.0), light("c", 95.0), light("d", 180.0)]
    assert phases(signals, ("a",)) == {"a": (9, 0), "b": (9, 1), "c": (9, 1), "d": (9, 2)}
