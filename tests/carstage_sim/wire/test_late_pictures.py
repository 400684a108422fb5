"""Which pictures may be late, and when the world waits for them all the same."""

from __future__ import annotations

import pytest

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


def end_urgent(turns: list[LatePicture]) -> int:
    """End turns as long as the world waits for them; how many."""
    count = 0
    while urgent := next(filter(LatePicture.is_urgent, turns), None):
        assert urgent.worth_making
        urgent.end()
        turns.remove(urgent)
        count += 1
    return count


def turns_of(late: LatePictures, *streams: int) -> list[LatePicture]:
    turns = [late.turn(stream) for stream in streams]
    return [turn for turn in turns if turn is not None]


def test_each_tick_waits_for_a_few_late_pictures_of_who_turns_out_to_read(
    late: LatePictures, subscribers: Subscribers
) -> None:
    turns = turns_of(late, STREAM, STREAM, STREAM)
    late.owe()
    assert not late.hold_up_the_world
    subscribers.taking[STREAM] = Taking.ALL
    late_ones = []
    for _ in range(4):
        # Later ones must not overtake those that wait.
        turns += turns_of(late, STREAM)
        late.owe()
        assert late.hold_up_the_world == bool(turns)
        end_urgent(turns)
        assert not late.hold_up_the_world
        late_ones.append(len(turns))
    assert late_ones == [2, 1, 0, 0]
    assert late.turn(STREAM) is None
    assert subscribers.changes == 6


def test_a_tick_waits_for_one_picture_more_than_streams_are_read(
    late: LatePictures, subscribers: Subscribers
) -> None:
    subscribers.taking[OTHER] = Taking.UNKNOWN
    turns = turns_of(late, STREAM, OTHER, STREAM, OTHER, OTHER)
    subscribers.taking.update({STREAM: Taking.ALL, OTHER: Taking.ALL})
    late.owe()
    assert end_urgent(turns) == 3
    assert [turn.stream_id for turn in turns] == [STREAM, OTHER]


def test_the_world_waits_when_too_many_pictures_of_a_stream_are_late(late: LatePictures) -> None:
    turns = [late.turn(STREAM) for _ in range(15)]
    assert not late.hold_up_the_world
    turns.append(late.turn(STREAM))
    assert late.hold_up_the_world
    assert turns[0] is not None
    turns[0].end()
    assert not late.hold_up_the_world


def test_pictures_that_nobody_takes_are_not_worth_making(
    late: LatePictures, subscribers: Subscribers
) -> None:
    turn = late.turn(STREAM)
    assert turn is not None
    assert turn.worth_making
    subscribers.taking[STREAM] = Taking.NOTHING
    assert not turn.worth_making
