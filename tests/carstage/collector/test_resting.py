"""Which cameras rest in steps that are not saved, and from which step on they count."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from carstage.collector.internals.matching import OFF, OK, ExpectedFrame, FrameMatcher
from carstage.collector.internals.plan import parse_plan
from carstage.collector.internals.resting import MOST_STEPS, NONE_RESTS, resting_sensors
from carstage.spec import EpisodeSpec

CAMERAS = {"CAM", "CAM.depth", "SEMANTIC", "CAM.instance"}


def spec(make_plan: Any, **changes: Any) -> EpisodeSpec:
    (episode,) = parse_plan(make_plan("raw", **{"save_every": 3, **changes})).episodes
    return episode.spec


@pytest.mark.parametrize(
    ("every", "warmup_ticks", "listening_ticks", "begin"),
    [
        (3, 6, 3, 3),
        (3, 6, 4, 0),
        (3, 6, 1, 3),
        (3, 6, 0, 3),
        (3, 6, None, 0),
        (4, 6, 3, 2),
        (4, 6, None, 2),
        (2, 6, 3, 2),
        (5, 6, 6, 1),
    ],
)
def test_saved_steps_are_whole_multiples_after_the_first_one(
    make_plan: Any, every: int, warmup_ticks: int, listening_ticks: int | None, begin: int
) -> None:
    planned = spec(make_plan, save_every=every, warmup_ticks=warmup_ticks)
    resting = resting_sensors(planned, True, listening_ticks)
    assert (resting.streams, resting.every, resting.begin) == (CAMERAS, every, begin)
    assert resting.interval_s == pytest.approx(every / 10.0)
    assert resting.measure_in(begin)
    assert resting.measure_in(warmup_ticks)  # the first that is saved
    assert not resting.measure_in(warmup_ticks + 1)
    assert not resting.measure_in(begin - every)


def test_none_rests_where_that_is_not_safe(make_plan: Any) -> None:
    assert resting_sensors(spec(make_plan), True, 3).streams
    assert resting_sensors(spec(make_plan), False, 3) == NONE_RESTS
    waits = copy.deepcopy(make_plan()["episodes"][0]["spec"]["timing"])
    ego = {"blueprint": "vehicle.tesla.model3", "spawn_index": 3}
    driver = {"kind": "class", "name": "package.module:Driver", "parameters": {}}
    for changes in (
        {"save_every": 1},
        {"save_every": 7},
        {"steps": MOST_STEPS},
        {"timing": {**waits, "on_incomplete": "skip"}},
        {"timing": {**waits, "sensor_sync": False}},
        {"ego": {**ego, "driver": driver}},
    ):
        assert resting_sensors(spec(make_plan, **changes), True, 3) == NONE_RESTS, changes


def test_a_sensor_that_rests_is_off_where_nothing_is_saved_and_missed_elsewhere() -> None:
    matcher = FrameMatcher(["CAM", "LIDAR"], 2.0, resting={"CAM"})
    matcher.begin(9)
    for tick, (frame, k) in enumerate([(10, 0), (11, None), (12, 1)]):
        matcher.expect(ExpectedFrame(tick, frame, 0.1 * tick, k, 0.01, None), 0.0)
        matcher.offer("LIDAR", frame, "points", 0.0)
    matcher.offer("CAM", 10, "picture", 0.0)
    matcher.offer("CAM", 11, "unasked", 0.0)
    matcher.advance(0.0)
    assert [frame.data for frame in matcher.take_joined()] == [
        {"LIDAR": "points", "CAM": "picture"},
        {"LIDAR": "points"},
    ]
    rows = matcher.take_rows()  # at once: nobody waits for one that rests
    assert [row.sensors["CAM"].state for row in rows] == [OK, OFF]
    assert matcher.take_dropped() == ["unasked"]
    matcher.advance(2.0)
    assert matcher.misses["CAM"] == 1
