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


def piece(
    work: Callable[[], object], pixels: int = 0, *, line: object = None, beside: bool = True
) -> Piece:
    def done() -> None:
        work()

    return Piece(done, work if line is None else line, pixels, beside)


def test_all_are_begun_and_the_next_are_begun_beside_them(side_by_side: SideBySide) -> None:
    go_on, done = threading.Event(), [False, False]

    def first() -> None:
        assert go_on.wait(WAIT_S)
        done[0] = True

    def second() -> None:
        done[1] = True

    one = side_by_side.begin([piece(first)])
    other = side_by_side.begin([piece(second)])
    other.result(WAIT_S)
    assert done == [False, True]
    assert not one.done()
    go_on.set()
    one.result(WAIT_S)
    assert done == [True, True]


def test_pieces_of_a_line_are_done_in_their_order(side_by_side: SideBySide) -> None:
    go_on, order = threading.Event(), list[int]()

    def first() -> None:
        assert go_on.wait(WAIT_S)
        order.append(1)

    side_by_side.begin([piece(first, line="a")])
    last = side_by_side.begin([piece(lambda: order.append(2), line="a")])
    side_by_side.begin([piece(lambda: order.append(3), line="b")]).result(WAIT_S)
    assert order == [3]
    assert not last.done()
    go_on.set()
    side_by_side.wait_for("a")
    assert order == [3, 1, 2]
    side_by_side.wait_for("a")  # nothing is left of it
    side_by_side.wait_for_all()


def test_what_the_caller_does_waits_for_its_line(side_by_side: SideBySide) -> None:
    order: list[int] = []

    def first() -> None:
        await_that(lambda: begun.is_set())
        order.append(1)

    begun = threading.Event()
    side_by_side.begin([piece(first, line="a")])
    here = piece(lambda: order.append(threading.get_ident()), line="a", beside=False)
    side_by_side.begin([here], begun.set).result(WAIT_S)
    assert order == [1, threading.get_ident()]


@pytest.mark.parametrize("count", [1, 3])
def test_it_is_told_when_the_first_pieces_are_begun(side_by_side: SideBySide, count: int) -> None:
    told: list[int] = []
    pieces = [piece(lambda: await_that(lambda: bool(told))) for _ in range(count)]
    side_by_side.begin(pieces, lambda: told.append(1)).result(WAIT_S)
    side_by_side.begin([], lambda: told.append(2)).result(WAIT_S)
    assert told == [1, 2]


def test_what_shares_more_is_done_by_the_caller_in_its_turn(side_by_side: SideBySide) -> None:
    threads: list[int] = []
    pieces = [
        piece(lambda: threads.append(threading.get_ident()), beside=number != 1)
        for number in range(3)
    ]
    side_by_side.begin(pieces).result(WAIT_S)
    assert threads.count(threading.get_ident()) == 1
    assert len(threads) == 3


def test_pictures_that_are_made_at_once_have_bounded_pixels(side_by_side: SideBySide) -> None:
    begun, go_on = list[int](), [threading.Event() for _ in range(3)]

    def make(number: int) -> Callable[[], None]:
        def work() -> None:
            begun.append(number)
            assert go_on[number].wait(WAIT_S)

        return work

    handed_over = threading.Thread(
        target=side_by_side.begin,
        args=([piece(make(n), pixels=1_500_000) for n in range(3)],),
    )
    handed_over.start()
    for number in range(3):
        await_that(lambda at=number: len(begun) > at)
        assert begun == list(range(number + 1))
        go_on[number].set()
    handed_over.join(WAIT_S)


def test_an_error_is_told_when_all_are_done(side_by_side: SideBySide) -> None:
    failed, ended = threading.Event(), threading.Event()

    def fail() -> None:
        failed.set()
        raise ValueError("the first")

    def last() -> None:
        assert failed.wait(WAIT_S)
        ended.set()

    with pytest.raises(ValueError, match="the first"):
        side_by_side.begin([piece(fail), piece(last)]).result(WAIT_S)
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
