"""Frames are joined by number; every sensor of every tick gets a state and a reason."""

from __future__ import annotations

import gc
import weakref

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from carstage.collector.internals.matching import (
    SPARSE_PATIENCE_S,
    ExpectedFrame,
    FrameMatcher,
    LedgerRow,
    LostData,
)

PATIENCE_S = 10.0


def matcher(*sensors: str, skip: bool = False) -> FrameMatcher:
    made = FrameMatcher(sensors or ("a", "b"), PATIENCE_S, skip)
    made.begin(99)
    return made


def tick(number: int) -> ExpectedFrame:
    return ExpectedFrame(number, 100 + number, number / 10, number, 0.01, None)


def states(row: LedgerRow) -> dict[str, str]:
    return {sensor: outcome.state for sensor, outcome in row.sensors.items()}


def test_a_frame_is_closed_when_every_sensor_delivered() -> None:
    frames = matcher()
    frames.expect(tick(0), 0.0)
    frames.offer("b", 100, "b0", 0.5)
    frames.advance(0.5)
    assert frames.take_joined() == []
    frames.offer("a", 100, "a0", 1.5)
    frames.advance(1.5)
    (joined,) = frames.take_joined()
    assert joined.data == {"a": "a0", "b": "b0"}
    (row,) = frames.take_rows()
    assert list(row.sensors) == ["a", "b"]
    assert states(row) == {"a": "ok", "b": "ok"}
    assert row.sensors["a"].wait_s == 1.5
    assert frames.idle


def test_data_may_overtake_the_news_of_their_tick() -> None:
    frames = matcher()
    frames.offer("a", 100, "a0", 0.0)
    frames.expect(tick(0), 0.1)
    frames.offer("b", 100, "b0", 0.1)
    frames.advance(0.1)
    assert states(frames.take_rows()[0]) == {"a": "ok", "b": "ok"}


def test_data_of_the_warm_up_are_dropped() -> None:
    frames = FrameMatcher(["a"], PATIENCE_S)
    frames.offer("a", 98, "before begin", 0.0)
    frames.begin(99)
    frames.offer("a", 99, "the last one", 0.0)
    frames.expect(tick(0), 0.0)
    frames.offer("a", 100, "a0", 0.0)
    frames.advance(0.0)
    assert frames.take_dropped() == ["before begin", "the last one"]
    assert frames.take_joined()[0].data == {"a": "a0"}


def test_what_came_before_the_beginning_counts_from_the_first_whole_frame_on() -> None:
    frames = FrameMatcher(["a", "b"], PATIENCE_S, gather=True)
    for number in (99, 100, 101):
        frames.offer("a", number, f"a{number}", 0.0)
    frames.offer("b", 100, "b100", 0.0)
    assert frames.take_dropped() == ["a99"]
    assert frames.begin_with_all() == 99
    frames.expect(tick(0), 0.0)
    frames.expect(tick(1), 0.0)
    frames.offer("b", 101, "b101", 0.0)
    frames.advance(0.0)
    joined = frames.take_joined()
    assert [one.data for one in joined] == [
        {"a": "a100", "b": "b100"},
        {"a": "a101", "b": "b101"},
    ]
    assert frames.take_dropped() == []


def test_recording_begins_after_what_was_lost_before_it() -> None:
    frames = FrameMatcher(["a", "b"], PATIENCE_S, gather=True)
    lost = LostData("too much")
    frames.offer("a", 100, "a100", 0.0)
    frames.offer("b", 100, "b100", 0.0)
    frames.offer("a", 101, lost, 0.0)
    assert frames.take_dropped() == ["a100", "b100"]
    frames.offer("b", 101, "b101", 0.0)
    frames.offer("a", 102, "a102", 0.0)
    frames.offer("b", 102, "b102", 0.0)
    assert frames.begin_with_all() == 101
    assert frames.take_dropped() == ["b101"]


def test_a_silent_sensor_is_recorded_as_missing_with_the_reason() -> None:
    frames = matcher()
    frames.expect(tick(0), 0.0)
    frames.offer("a", 100, "a0", 0.0)
    frames.advance(PATIENCE_S - 0.1)
    assert frames.take_joined() == []
    frames.advance(PATIENCE_S)
    assert frames.take_joined()[0].data == {"a": "a0"}
    frames.advance(2 * PATIENCE_S)
    (row,) = frames.take_rows()
    assert states(row) == {"a": "ok", "b": "missing"}
    assert "delivered nothing for 10 s" in str(row.sensors["b"].reason)
    assert frames.misses == {"a": 0, "b": 1}


def test_a_frame_that_is_held_stays_open_until_it_is_given_up_or_goes_on() -> None:
    frames = matcher()
    frames.hold(True)
    for number in range(2):
        frames.expect(tick(number), 0.0)
    frames.offer("a", 100, "a0", 0.0)
    assert frames.next_deadline_s() is None
    frames.advance(3 * PATIENCE_S)
    assert frames.take_joined() == []
    frames.hold(False)
    frames.advance(3 * PATIENCE_S)
    assert [joined.data for joined in frames.take_joined()] == [{"a": "a0"}, {}]
    frames.expect(tick(2), 0.0)
    frames.offer("b", 102, "b2", 0.0)
    frames.drop_open()
    assert frames.take_dropped() == ["b2"]
    frames.advance(9 * PATIENCE_S)
    assert frames.take_joined() == []


def test_data_after_the_deadline_are_recorded_as_late_and_not_kept() -> None:
    frames = matcher()
    frames.expect(tick(0), 0.0)
    frames.offer("a", 100, "a0", 0.0)
    frames.advance(PATIENCE_S)
    frames.offer("b", 100, "too late", PATIENCE_S + 1)
    frames.advance(PATIENCE_S + 1)
    (row,) = frames.take_rows()
    assert states(row) == {"a": "ok", "b": "late"}
    assert row.sensors["b"].wait_s == PATIENCE_S + 1
    assert frames.take_joined()[0].data == {"a": "a0"}
    assert frames.take_dropped() == ["too late"]


def test_a_sensor_that_passed_a_frame_over_is_recorded_as_mismatched() -> None:
    frames = matcher()
    for number in range(2):
        frames.expect(tick(number), 0.0)
        frames.offer("a", 100 + number, f"a{number}", 0.0)
    frames.offer("b", 101, "b1", 0.0)
    frames.advance(0.0)
    assert frames.take_joined() == []
    frames.advance(2 * PATIENCE_S)
    first, second = frames.take_rows()
    assert states(first) == {"a": "ok", "b": "mismatched"}
    assert "delivered frame 101" in str(first.sensors["b"].reason)
    assert states(second) == {"a": "ok", "b": "ok"}


def test_skipping_does_not_wait_for_a_frame_that_was_passed_over() -> None:
    frames = matcher(skip=True)
    for number in range(2):
        frames.expect(tick(number), 0.0)
        frames.offer("a", 100 + number, f"a{number}", 0.0)
    frames.offer("b", 101, "b1", 0.0)
    frames.advance(0.0)
    assert [frame.expected.tick for frame in frames.take_joined()] == [0, 1]


def test_a_complete_frame_waits_for_the_incomplete_one_before_it() -> None:
    frames = matcher("a")
    frames.expect(tick(0), 0.0)
    frames.expect(tick(1), 0.0)
    frames.offer("a", 101, "a1", 0.0)
    frames.advance(1.0)
    assert frames.take_joined() == []
    frames.offer("a", 100, "a0", 2.0)
    frames.advance(2.0)
    assert [frame.expected.tick for frame in frames.take_joined()] == [0, 1]


def test_what_is_delivered_twice_or_for_no_tick_of_ours_is_dropped() -> None:
    frames = matcher("a")
    frames.expect(ExpectedFrame(0, 105, 0.0, 0, 0.0, None), 0.0)
    frames.offer("a", 103, "stray", 0.0)
    frames.offer("a", 105, "first", 0.0)
    frames.offer("a", 105, "second", 0.0)
    frames.offer("a", 107, "early stray", 0.0)
    frames.offer("a", 107, "early again", 0.0)
    frames.expect(ExpectedFrame(1, 110, 0.1, 1, 0.0, None), 0.0)
    frames.advance(0.0)
    assert frames.take_joined()[0].data == {"a": "first"}
    assert frames.take_dropped() == ["stray", "second", "early again", "early stray"]


def test_data_of_ticks_that_passed_unseen_can_be_forgotten() -> None:
    frames = matcher("a")
    frames.expect(tick(0), 0.0)
    frames.offer("a", 101, "nobody saw its tick", 0.0)
    frames.forget_early()
    frames.offer("a", 100, "a0", 0.0)
    frames.expect(tick(2), 0.0)
    frames.offer("a", 102, "a2", 0.0)
    frames.advance(0.0)
    assert [frame.data for frame in frames.take_joined()] == [{"a": "a0"}, {"a": "a2"}]
    assert frames.take_dropped() == ["nobody saw its tick"]


def test_data_that_are_handed_on_are_not_kept_while_a_row_is_open() -> None:
    class Picture:
        pass

    frames = matcher()
    for number in range(2):
        frames.expect(tick(number), 0.0)
        frames.offer("a", 100 + number, Picture(), 0.0)
    frames.advance(PATIENCE_S)
    held = [weakref.ref(frame.data["a"]) for frame in frames.take_joined()]
    gc.collect()
    assert len(held) == 2
    assert not frames.idle, "the rows wait for what may still come late"
    assert [reference() for reference in held] == [None, None]


def test_the_next_deadline_is_that_of_the_oldest_frame() -> None:
    frames = matcher("a")
    assert frames.next_deadline_s() is None
    frames.expect(tick(0), 3.0)
    frames.expect(tick(1), 4.0)
    assert frames.next_deadline_s() == 3.0 + PATIENCE_S


@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_any_order_of_arrival_gives_one_whole_row_per_tick(data: st.DataObject) -> None:
    sensors = ("a", "b", "c")
    ticks = data.draw(st.integers(1, 6))
    arrivals = [("tick", 100 + number) for number in range(ticks)]
    per_sensor = [[(sensor, 100 + number) for number in range(ticks)] for sensor in sensors]
    lanes = [arrivals, *per_sensor]
    frames = matcher(*sensors)
    joined = []
    rows = []
    while any(lanes):
        lane = data.draw(st.sampled_from([lane for lane in lanes if lane]))
        name, frame = lane.pop(0)
        if name == "tick":
            frames.expect(tick(frame - 100), 0.0)
        else:
            frames.offer(name, frame, f"{name}{frame}", 0.0)
        frames.advance(0.0)
        joined += frames.take_joined()
        rows += frames.take_rows()
    assert [frame.expected.tick for frame in joined] == list(range(ticks))
    assert [row.expected.tick for row in rows] == list(range(ticks))
    for frame in joined:
        assert frame.data == {name: f"{name}{frame.expected.frame}" for name in sensors}
    assert all(set(states(row).values()) == {"ok"} for row in rows)
    assert frames.take_dropped() == []
    assert frames.idle


@pytest.mark.parametrize("skip", [False, True])
def test_nothing_is_waited_for_without_end(skip: bool) -> None:
    frames = matcher("a", "b", skip=skip)
    for number in range(3):
        frames.expect(tick(number), 0.0)
    frames.advance(2 * PATIENCE_S)
    assert len(frames.take_rows()) == 3
    assert frames.idle


def test_a_frame_that_the_server_skipped_is_missing_in_every_sensor_at_once() -> None:
    frames = matcher()
    frames.offer("a", 100, "a0", 0.0)
    frames.expect(tick(0)._replace(seen=False), 0.1)
    frames.advance(0.1)
    (row,) = frames.take_rows()
    assert states(row) == {"a": "missing", "b": "missing"}
    assert "never came" in str(row.sensors["a"].reason)
    assert frames.take_joined()[0].data == {}
    assert frames.take_dropped() == ["a0"]
    assert frames.idle


def test_a_sensor_with_its_own_timeline_is_off_between_its_measurements() -> None:
    frames = FrameMatcher(["a", "b"], PATIENCE_S, skip=True, own_timelines=True)
    frames.begin(99)
    for number in range(3):
        frames.expect(tick(number), number)
        frames.offer("a", 100 + number, number, number)
    frames.offer("b", 102, "b2", 2.0)
    frames.advance(2.0)
    assert [list(joined.data) for joined in frames.take_joined()] == [["a"], ["a"], ["a", "b"]]
    frames.advance(2.0 + 2 * PATIENCE_S)
    assert [states(row)["b"] for row in frames.take_rows()] == ["off", "off", "ok"]
    assert frames.misses == {"a": 0, "b": 0}


def test_data_of_an_own_timeline_that_come_too_late_are_still_told_apart() -> None:
    frames = FrameMatcher(["a"], PATIENCE_S, skip=True, own_timelines=True)
    frames.begin(99)
    frames.expect(tick(0), 0.0)
    frames.advance(PATIENCE_S)
    frames.offer("a", 100, "a0", PATIENCE_S + 1.0)
    frames.advance(PATIENCE_S + 1.0)
    assert states(frames.take_rows()[0]) == {"a": "late"}


def sparse_matcher(*sensors: str, gather: bool = False) -> FrameMatcher:
    made = FrameMatcher(sensors or ("a", "s"), PATIENCE_S, gather=gather, sparse=["s"])
    if not gather:
        made.begin(99)
    return made


def test_a_sparse_sensor_without_data_is_ok_once_the_next_frame_is_whole() -> None:
    frames = sparse_matcher()
    for number in range(2):
        frames.expect(tick(number), 0.1 * number)
        frames.advance(0.1 * number)
        frames.offer("a", 100 + number, number, 0.1 * number)
        frames.advance(0.1 * number)
    (joined,) = frames.take_joined()
    assert joined.data == {"a": 0}
    assert states(frames.take_rows()[0]) == {"a": "ok", "s": "ok"}
    assert frames.misses == {"a": 0, "s": 0}


def test_what_a_sparse_sensor_lost_is_missing_and_not_empty() -> None:
    frames = sparse_matcher()
    for number in range(2):
        frames.expect(tick(number), 0.0)
        frames.offer("a", 100 + number, number, 0.0)
    frames.offer("s", 100, LostData("too much"), 0.0)
    frames.advance(0.0)
    frames.advance(SPARSE_PATIENCE_S)
    assert [joined.empty for joined in frames.take_joined()] == [(), ("s",)]
    assert [states(row)["s"] for row in frames.take_rows()] == ["missing", "ok"]


def test_the_last_frame_is_closed_after_a_short_while() -> None:
    frames = sparse_matcher()
    frames.expect(tick(0), 0.0)
    frames.offer("a", 100, "a0", 0.2)
    frames.advance(0.2)
    assert frames.next_deadline_s() == 0.2 + SPARSE_PATIENCE_S
    frames.advance(0.2 + SPARSE_PATIENCE_S - 0.01)
    assert frames.take_joined() == []
    frames.advance(0.2 + SPARSE_PATIENCE_S)
    assert len(frames.take_joined()) == 1
    assert frames.idle


def test_data_of_a_sparse_sensor_join_their_frame() -> None:
    frames = sparse_matcher()
    frames.expect(tick(0), 0.0)
    frames.offer("a", 100, "a0", 0.0)
    frames.offer("s", 100, "s0", 0.1)
    frames.advance(0.1)
    assert frames.take_joined()[0].data == {"a": "a0", "s": "s0"}


def test_other_sensors_are_waited_for_as_without_a_sparse_one() -> None:
    frames = sparse_matcher()
    frames.expect(tick(0), 0.0)
    frames.offer("s", 100, "s0", 0.0)
    frames.advance(PATIENCE_S - 0.1)
    assert frames.take_joined() == []
    frames.advance(PATIENCE_S)
    frames.advance(2 * PATIENCE_S)
    assert states(frames.take_rows()[0]) == {"a": "missing", "s": "ok"}


def test_sparse_data_of_a_frame_that_was_closed_as_empty_are_told() -> None:
    frames = sparse_matcher()
    frames.expect(tick(0), 0.0)
    frames.offer("a", 100, "a0", 0.0)
    frames.advance(0.0)
    frames.advance(SPARSE_PATIENCE_S)
    frames.offer("s", 100, "s0", 1.0)
    assert frames.take_too_late() == [("s", 100)]
    assert frames.take_dropped() == ["s0"]
    assert frames.take_too_late() == []


def test_a_recording_begins_without_a_sparse_sensor() -> None:
    frames = sparse_matcher("a", "s", gather=True)
    for number in range(3):
        frames.offer("a", 100 + number, number, 0.0)
    frames.offer("s", 102, "s2", 0.0)
    assert frames.begin_with_all() == 99


def test_sparse_sensors_alone_have_every_frame() -> None:
    frames = sparse_matcher("s")
    for number in range(2):
        frames.expect(tick(number), 0.0)
    frames.advance(0.0)
    assert frames.take_joined() == []
    frames.advance(SPARSE_PATIENCE_S)
    assert [joined.data for joined in frames.take_joined()] == [{}, {}]
