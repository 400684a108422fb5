"""Lights that several events hold at one junction."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import carla
import pytest

from carstage.collector.scenario.events.signals import HOLD_S, HeldSignals
from carstage.collector.scenario.storyboard.conditions import _compares

OWN = {"green": 10.0, "yellow": 3.0, "red": 2.0}
GREEN, RED = carla.TrafficLightState.Green, carla.TrafficLightState.Red


@dataclass
class Light:
    """A light as the client shows it."""

    id: int
    times: dict[str, float] = field(
        default_factory=lambda: {"green": 10.0, "yellow": 3.0, "red": 2.0}
    )
    shown: Any = None
    cycles: int = 0

    def __getattr__(self, name: str) -> Any:
        verb, _, rest = name.partition("_")
        key = rest.removesuffix("_time")
        if verb == "get" and key in ("green", "yellow", "red"):
            return lambda: self.times[key]
        if verb == "set" and key in ("green", "yellow", "red"):
            return lambda value: self.times.update({key: value})
        raise AttributeError(name)

    def set_state(self, state: Any) -> None:
        self.shown = state

    def reset_group(self) -> None:
        self.cycles += 1


@pytest.mark.parametrize("first_ends_first", [True, False])
def test_a_junction_that_two_hold_has_its_own_times_again_after_both(
    first_ends_first: bool,
) -> None:
    lights, held = [Light(1), Light(2)], {}
    first = HeldSignals([lights[0]], lights, held)
    second = HeldSignals([lights[1]], lights, held)
    assert [light.shown for light in lights] == [RED, GREEN]
    ends, stays = (first, second) if first_ends_first else (second, first)
    ends.release()
    assert lights[0].times["green"] == HOLD_S
    assert [light.shown for light in lights] == ([RED, GREEN] if stays is second else [GREEN, RED])
    ends.release()
    assert lights[0].cycles == 0
    stays.release()
    assert [light.times for light in lights] == [OWN, OWN]
    assert lights[0].cycles == 1


def test_a_third_holds_what_two_have_left() -> None:
    lights, held = [Light(1)], {}
    HeldSignals(lights, lights, held).release()
    again = HeldSignals([], lights, held)
    assert lights[0].shown == RED
    again.release()
    assert lights[0].times["green"] == 10.0


@pytest.mark.parametrize("step", [2, 3, 4, 5, 6, 7])
def test_strict_rules_hold_a_step_after_the_limit_whatever_it_is(step: int) -> None:
    limit = float(f"0.{step}")
    values = [0.1 * k for k in range(step - 1, step + 2)]
    assert [_compares(v, "greaterThan", limit, 1e-6) for v in values] == [False, False, True]
    assert [_compares(v, "lessThan", limit, 1e-6) for v in values] == [True, False, False]
