"""The warm-up waits for streams to come up, not for sensors that need not measure, and tells."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from carstage.collector.internals.plan import EpisodePlan
from carstage.collector.internals.resting import NONE_RESTS, Resting, resting_sensors
from carstage.collector.internals.warmup import WAIT_S, warm_up


class Pretended:
    """Scene, pipeline and events at once, on a clock of their own; the sensor never delivers."""

    def __init__(self, resting: Resting = NONE_RESTS) -> None:
        self.resting = resting
        self.listened: dict[int, list[str]] = {}
        self.now_s = 0.0
        self.frame = 10
        self.told: list[int] = []

    def listen(self, callback: Any, wanted: Any) -> None:
        del callback
        names = [name for name in ("SLOW", "FAST") if wanted(name)]
        self.listened.setdefault(len(self.told), []).extend(names)

    def step(self, tick: int | None) -> Any:
        del tick
        self.frame += 1
        return SimpleNamespace(frame=self.frame)

    def check(self) -> None:
        pass

    def callback(self, sensor: str) -> None:
        del sensor

    def wait_delivered(self, frame: int, timeout_s: float, instead: Any = None) -> tuple[str, ...]:
        del frame
        if instead.get("SLOW") == -1:
            return ()
        self.now_s += timeout_s
        return ("SLOW",)

    def begin(self, after_frame: int) -> None:
        self.began_after = after_frame

    def warm_up(self, episode_id: str, *, tick: int, ticks: int) -> None:
        del episode_id, ticks
        self.told.append(tick)


def warmed(
    *,
    own_timelines: bool,
    listening_ticks: int | None = None,
    patience_s: float = WAIT_S,
    resting: Resting = NONE_RESTS,
) -> Pretended:
    """Five ticks of a warm-up."""
    spec: Any = SimpleNamespace(
        warmup_ticks=5,
        sensors=[SimpleNamespace(id="SLOW")],
        timing=SimpleNamespace(sensor_sync=not own_timelines),
    )
    everything: Any = Pretended(resting)
    episode = EpisodePlan("id", "a1", "raw", spec)
    warm_up(
        *(everything, everything, episode, listening_ticks, everything, everything, patience_s),
        clock_s=lambda: everything.now_s,
    )
    pretended: Pretended = everything
    return pretended


@pytest.mark.parametrize(("listening_ticks", "waits"), [(None, 5), (2, 2), (0, 0)])
def test_each_tick_of_sensors_in_step_is_waited_for(
    listening_ticks: int | None, waits: int
) -> None:
    assert warmed(own_timelines=False, listening_ticks=listening_ticks).now_s == waits * WAIT_S


def test_last_tick_is_waited_for_as_long_as_a_recorded_frame() -> None:
    """Else what the warm-up leaves to be drawn on a busy machine makes recorded frames late."""
    assert warmed(own_timelines=False, patience_s=61.0).now_s == 4 * WAIT_S + 61.0
    assert warmed(own_timelines=False, patience_s=1.0).now_s == 5 * WAIT_S


def test_sensor_with_a_timeline_of_its_own_is_not_waited_for_in_each_tick() -> None:
    assert warmed(own_timelines=True).now_s == WAIT_S


def test_each_tick_is_a_sign_of_life() -> None:
    warm = warmed(own_timelines=False)
    assert warm.told == [0, 1, 2, 3, 4]
    assert warm.began_after == 15


def test_a_sensor_with_a_rate_of_its_own_is_listened_to_from_its_tick_on() -> None:
    warm = warmed(own_timelines=True, resting=Resting(own={"SLOW": 2}))
    assert warm.listened == {0: ["FAST"], 2: ["SLOW"]}
    assert warm.now_s == WAIT_S
    assert warmed(own_timelines=True, resting=Resting(own={"SLOW": 5})).now_s == 0.0


@pytest.mark.parametrize(
    ("warmup", "rate_hz", "listening_ticks", "begin"),
    [
        (40, 5.0, None, 0),
        (41, 5.0, None, 1),
        (41, 5.0, 6, 37),
        (3, 5.0, None, 3),
        (40, 10.0, 3, 38),
        (40, 7.0, None, 0),
        (40, 15.0, None, 0),
        (41, 7.0, None, 1),
    ],
)
def test_sensors_with_a_rate_of_their_own_measure_in_the_first_recorded_step(
    warmup: int, rate_hz: float, listening_ticks: int | None, begin: int
) -> None:
    spec: Any = SimpleNamespace(
        save_every=4,
        warmup_ticks=warmup,
        step_s=0.05,
        timing=SimpleNamespace(sensor_sync=False),
        streams={
            "SLOW": SimpleNamespace(attributes={"sensor_tick": repr(1.0 / rate_hz)}),
            "FAST": SimpleNamespace(attributes={}),
        },
    )
    assert resting_sensors(spec, True, listening_ticks) == Resting(own={"SLOW": begin})
