"""Sensors of a tick are measured side by side, and reported as they are done."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import pytest

from carstage_sim.sensors.side_by_side import Once, Piece, SideBySide
from waiting import await_that

WAIT_S = 10.0


@pytest.fixture
def side_by_side() -> Iterator[SideBySide]:
    one = SideBySide(4)
    yield one
    one.close()


def piece(work: Callable[[], int], pixels: int = 0, beside: bool = True) -> Piece[int]:
    return Piece(work, pixels, beside)


def test_a_result_comes_while_an_earlier_piece_is_still_being_done(
    side_by_side: SideBySide,
) -> None:
    taken = threading.Event()

    def first() -> int:
        assert taken.wait(WAIT_S)
        return 1

    results = side_by_side.results([piece(first), piece(lambda: 2)])
    assert next(results) == (1, 2)
    taken.set()
    assert list(results) == [(0, 1)]


@pytest.mark.parametrize("count", [1, 3])
def test_it_is_told_when_the_first_pieces_are_begun(side_by_side: SideBySide, count: int) -> None:
    told: list[int] = []

    def work() -> int:
        await_that(lambda: bool(told))
        return len(told)

    pieces = [piece(work) for _ in range(count)]
    results = sorted(side_by_side.results(pieces, lambda: told.append(1)))
    assert results == [(number, 1) for number in range(count)]
    assert list(side_by_side.results([], lambda: told.append(2))) == []
    assert told == [1, 2]


def test_what_shares_more_is_done_by_the_caller_in_its_turn(side_by_side: SideBySide) -> None:
    pieces = [piece(threading.get_ident, beside=number != 1) for number in range(3)]
    threads = dict(side_by_side.results(pieces))
    assert threads[1] == threading.get_ident()
    assert threading.get_ident() not in (threads[0], threads[2])


def test_pictures_that_are_made_at_once_have_bounded_pixels(side_by_side: SideBySide) -> None:
    begun: list[int] = []

    def make(number: int) -> Callable[[], int]:
        def work() -> int:
            begun.append(number)
            return number

        return work

    results = side_by_side.results([piece(make(n), pixels=1_500_000) for n in range(3)])
    for number in range(3):
        assert next(results) == (number, number)
        assert begun == list(range(number + 1))


def test_after_an_error_nothing_goes_on(side_by_side: SideBySide) -> None:
    begun, ended, failed = threading.Event(), threading.Event(), threading.Event()

    def fail() -> int:
        assert begun.wait(WAIT_S)
        failed.set()
        raise ValueError("the first")

    def last() -> int:
        begun.set()
        assert failed.wait(WAIT_S)
        ended.set()
        return 2

    results = side_by_side.results([piece(fail), piece(last)])
    with pytest.raises(ValueError, match="the first"):
        list(results)
    assert ended.is_set()


def test_what_is_made_once_is_made_once_and_again_after_an_error() -> None:
    made: list[int] = []

    def make() -> int:
        made.append(1)
        if len(made) == 1:
            raise KeyError("the first")
        return len(made)

    once = Once(make)
    with pytest.raises(KeyError, match="the first"):
        once()
    assert (once(), once()) == (2, 2)
