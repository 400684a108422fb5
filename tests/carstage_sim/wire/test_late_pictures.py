"""Which pictures may be late, and when the world waits for them all the same."""

from __future__ import annotations

import pytest

from carstage_sim.wire import late_pictures
from carstage_sim.wire.late_pictures import LatePicture, LatePictures
from carstage_sim.wire.streaming import Taking

STREAM, OTHER = 7, 8


class Subscribers:
    """What is taken of each stream, and how often somebody heard of a change."""

    def __init__(self) -> None:
        self.taking = {STREAM: Taking.UNKNOWN, OTHER: Taking.ALL}
        self.changes = 0

    def changed(self) -> None:
        self.changes += 1


@pytest.fixture
def subscribers() -> Subscribers:
    return Subscribers()


@pytest.fixture
def late(subscribers: Subscribers) -> LatePictures:
    return LatePictures(subscribers.taking.__getitem__, subscribers.changed)


def test_who_takes_everything_gets_pictures_that_the_world_waits_for(late: LatePictures) -> None:
    assert late.turn(OTHER) is None
    assert not late.hold_up_the_world


def turns_of(late: LatePictures, *streams: int) -> list[LatePicture]:
    turns = [late.turn(stream) for stream in streams]
    return [turn for turn in turns if turn is not None]


class Clock:
    """The monotonic clock, which stands still until it is moved."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(late_pictures.time, "monotonic", clock)
    return clock


def test_each_tick_leaves_a_moment_for_late_pictures_of_who_turns_out_to_read(
    late: LatePictures, subscribers: Subscribers, clock: Clock
) -> None:
    turns = turns_of(late, STREAM, STREAM)
    late.begin_frame()
    assert not late.hold_up_the_world
    subscribers.taking[STREAM] = Taking.ALL
    # Later ones must not overtake those that wait.
    turns += turns_of(late, STREAM)
    assert len(turns) == 3
    for _ in range(3):
        late.begin_frame()
        assert late.hold_up_the_world
        clock.now_s += 0.3
        assert not late.hold_up_the_world
        late.begin_frame()
        turns.pop().end()
        assert late.hold_up_the_world == bool(turns)
    assert late.turn(STREAM) is None
    assert subscribers.changes == 3


def test_a_tick_leaves_a_moment_for_streams_of_which_many_wait(
    late: LatePictures, clock: Clock
) -> None:
    turns = turns_of(late, *[STREAM] * 15)
    late.begin_frame()
    assert not late.hold_up_the_world
    turns += turns_of(late, STREAM)
    assert late.hold_up_the_world
    clock.now_s += 0.3
    assert not late.hold_up_the_world
    late.begin_frame()
    turns[0].end()
    assert not late.hold_up_the_world


def test_the_world_waits_for_as_long_as_it_takes_where_very_many_wait_and_are_read(
    late: LatePictures, subscribers: Subscribers, clock: Clock
) -> None:
    turns = turns_of(late, *[STREAM] * 64)
    late.begin_frame()
    clock.now_s += 10.0
    assert not late.hold_up_the_world
    subscribers.taking[STREAM] = Taking.ALL
    assert late.hold_up_the_world
    turns[0].end()
    assert not late.hold_up_the_world


def test_who_reads_comes_before_who_has_many_waiting_and_that_before_others(
    late: LatePictures, subscribers: Subscribers
) -> None:
    subscribers.taking[OTHER] = Taking.UNKNOWN
    (turn,) = turns_of(late, STREAM)
    assert turn.urgency() == 0
    turns = turns_of(late, *[OTHER] * 16)
    assert {one.urgency() for one in turns} == {1}
    subscribers.taking[STREAM] = Taking.ALL
    assert turn.urgency() == 2


def test_pictures_that_nobody_takes_are_not_worth_making(
    late: LatePictures, subscribers: Subscribers
) -> None:
    turn = late.turn(STREAM)
    assert turn is not None
    assert turn.worth_making
    subscribers.taking[STREAM] = Taking.NOTHING
    assert not turn.worth_making


CLIENT, OTHER_CLIENT = 3, 4


def test_tick_waits_until_fewer_pictures_of_who_asks_are_late_than_before_the_last_one(
    late: LatePictures, clock: Clock
) -> None:
    turns: list[LatePicture] = []
    for _ in range(4):
        turns += [one for one in [late.turn(STREAM, CLIENT)] if one is not None]
        late.begin_frame()
    clock.now_s += 10.0
    assert not late.hold_up_the_world
    for left in (2, 1, 1):
        late.asked_by({CLIENT})
        while len(turns) > left:
            assert late.hold_up_the_world
            assert turns[0].urgency() == 3
            turns.pop(0).end()
        assert not late.hold_up_the_world
        assert turns[0].urgency() == 0
        turns += [one for one in [late.turn(STREAM, CLIENT)] if one is not None]
        late.begin_frame()
        clock.now_s += 10.0


def test_late_pictures_of_one_client_hold_up_no_tick_that_another_asks_for_too(
    late: LatePictures, clock: Clock
) -> None:
    for _ in range(2):
        late.turn(STREAM, CLIENT)
        late.begin_frame()
    clock.now_s += 10.0
    for asking, holds in [({CLIENT}, True), ({CLIENT, OTHER_CLIENT}, False), (set[int](), False)]:
        late.asked_by(asking)
        assert late.hold_up_the_world == holds
