"""Work that one thread hands to another, or does itself while that has nothing to do."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from functools import partial

import pytest

from carstage_sim.drawing import DrawingThread
from waiting import await_that


@pytest.fixture
def drawing() -> Iterator[DrawingThread]:
    thread = DrawingThread()
    yield thread
    thread.close()


def test_work_is_done_in_order_in_one_other_thread(drawing: DrawingThread) -> None:
    done: list[tuple[int, str]] = []

    def work(number: int) -> None:
        done.append((number, threading.current_thread().name))

    for number in range(200):
        drawing.submit(work, number)
    drawing.finish()
    assert [number for number, _ in done] == list(range(200))
    (name,) = {name for _, name in done}
    assert name != threading.current_thread().name
    assert not drawing.busy


def test_work_is_done_here_unless_the_thread_is_busy(drawing: DrawingThread) -> None:
    here = threading.get_ident()
    assert drawing.at_once_or_later(threading.get_ident).result(0) == here
    gate = threading.Event()
    drawing.submit(gate.wait)
    await_that(lambda: drawing.busy)
    later = drawing.at_once_or_later(threading.get_ident)
    assert not later.done()
    gate.set()
    assert later.result(10.0) != here


def test_an_error_is_raised_where_the_result_is_asked_for(drawing: DrawingThread) -> None:
    with pytest.raises(ZeroDivisionError):
        drawing.at_once_or_later(divmod, 1, 0).result()
    with pytest.raises(ZeroDivisionError):
        drawing.submit(divmod, 1, 0).result()
    drawing.finish()
    assert not drawing.busy


def test_far_too_much_work_makes_who_hands_it_over_wait(drawing: DrawingThread) -> None:
    gate, handed = threading.Event(), []

    def hand_over() -> None:
        for number in range(1000):
            drawing.submit(gate.wait)
            handed.append(number)

    thread = threading.Thread(target=hand_over)
    thread.start()
    await_that(lambda: len(handed) >= 64)
    assert len(handed) < 1000
    gate.set()
    thread.join()
    assert len(handed) == 1000


def put_off_behind_a_gate(drawing: DrawingThread, work: Callable[[], None]) -> threading.Event:
    """Put work off and wait until it is begun; it is done when the gate is set."""
    gate, began = threading.Event(), threading.Event()

    def gated() -> None:
        began.set()
        gate.wait()
        work()

    drawing.put_off(gated)
    assert began.wait(10.0)
    return gate


def test_what_is_put_off_comes_after_all_else_that_waits_one_piece_at_a_time(
    drawing: DrawingThread,
) -> None:
    done: list[str] = []
    gate = put_off_behind_a_gate(drawing, partial(done.append, "put off 0"))
    for number in (1, 2):
        drawing.put_off(partial(done.append, f"put off {number}"))
    for number in range(3):
        drawing.submit(done.append, f"submitted {number}")
    assert drawing.busy
    gate.set()
    drawing.finish()
    submitted = [f"submitted {number}" for number in range(3)]
    assert done == ["put off 0", *submitted, "put off 1", "put off 2"]
    assert not drawing.busy


def test_what_is_put_off_may_fail_and_the_rest_is_done(drawing: DrawingThread) -> None:
    done: list[int] = []
    drawing.put_off(lambda: done.append(1 // 0))
    drawing.put_off(partial(done.append, 1))
    drawing.finish()
    assert done == [1]


def test_at_the_end_what_is_put_off_and_not_begun_is_left_out(drawing: DrawingThread) -> None:
    done: list[int] = []
    gate = put_off_behind_a_gate(drawing, partial(done.append, 0))
    drawing.put_off(partial(done.append, 1))
    ending = threading.Thread(target=drawing.finish_without_what_is_put_off)
    ending.start()
    gate.set()
    ending.join()
    assert done == [0]
    drawing.put_off(partial(done.append, 2))
    drawing.finish()
    assert done == [0, 2]


def test_while_held_nothing_that_is_put_off_is_begun_though_it_was_queued(
    drawing: DrawingThread,
) -> None:
    done: list[str] = []
    gate = put_off_behind_a_gate(drawing, partial(done.append, "put off 0"))
    drawing.put_off(partial(done.append, "put off 1"))
    drawing.submit(partial(drawing.hold, held=True))  # after the second was queued
    gate.set()
    drawing.submit(done.append, "submitted").result(10.0)
    drawing.submit(done.append, "submitted").result(10.0)
    assert done == ["put off 0", "submitted", "submitted"]
    assert drawing.busy
    drawing.hold(held=False)
    drawing.finish()
    assert done[3:] == ["put off 1"]


@pytest.mark.parametrize("finish", ["finish", "finish_without_what_is_put_off"])
def test_who_waits_for_the_end_does_not_wait_for_what_is_held(
    drawing: DrawingThread, finish: str
) -> None:
    done: list[int] = []
    drawing.hold(held=True)
    drawing.put_off(partial(done.append, 1))
    getattr(drawing, finish)()
    assert done == ([1] if finish == "finish" else [])
    assert not drawing.busy


def test_what_is_urgent_comes_first_of_what_is_put_off_held_or_not(drawing: DrawingThread) -> None:
    done: list[str] = []
    gate = threading.Event()
    drawing.hold(held=True)
    drawing.submit(gate.wait)
    for name, urgency in {"first": 0, "many 1": 1, "read 1": 2, "many 2": 1, "read 2": 2}.items():
        line = name.split(maxsplit=1)[0]
        drawing.put_off(partial(done.append, name), line, lambda urgency=urgency: urgency)
    gate.set()
    await_that(lambda: len(done) == 4)
    drawing.finish()
    assert done == ["read 1", "read 2", "many 1", "many 2", "first"]


def test_pieces_of_a_line_keep_their_order_while_one_of_them_becomes_urgent(
    drawing: DrawingThread,
) -> None:
    done: list[str] = []
    asked = iter(range(10))
    gate = put_off_in_pieces(drawing, done, lambda: next(asked))
    drawing.put_off(partial(done.append, "same line"), "line", lambda: 99)
    drawing.put_off(partial(done.append, "other line"), "other", lambda: 100)
    gate.set()
    drawing.finish()
    assert done == ["other line", "put off", "same line"]


def test_who_put_off_what_is_left_out_hears_of_it(drawing: DrawingThread) -> None:
    done: list[str] = []
    drawing.hold(held=True)
    drawing.put_off(partial(done.append, "done"), leave_out=partial(done.append, "left out"))
    drawing.finish_without_what_is_put_off()
    assert done == ["left out"]


def put_off_in_pieces(
    drawing: DrawingThread, done: list[str], urgency: Callable[[], int] = lambda: 0
) -> threading.Event:
    """Put work off that gives way when the gate is set, and wait until it is begun."""
    gate, began = threading.Event(), threading.Event()

    def in_pieces() -> None:
        began.set()
        gate.wait()
        drawing.give_way()
        done.append("put off")

    drawing.put_off(in_pieces, "line", urgency)
    assert began.wait(10.0)
    return gate


def test_other_work_is_done_while_a_piece_that_is_put_off_gives_way(
    drawing: DrawingThread,
) -> None:
    done: list[str] = []
    gate = put_off_in_pieces(drawing, done)

    def submitted() -> None:
        drawing.give_way()  # which does nothing in other work
        done.append("submitted")

    for _ in range(2):
        drawing.submit(submitted)
    gate.set()
    drawing.finish()
    assert done == ["submitted", "submitted", "put off"]
    assert not drawing.busy


@pytest.mark.parametrize("goes_on", ["it is urgent", "it is not held any more", "all ends"])
def test_a_piece_that_gives_way_while_held_goes_on_when(
    drawing: DrawingThread, goes_on: str
) -> None:
    done: list[str] = []
    urgent: list[bool] = []
    gate = put_off_in_pieces(drawing, done, lambda: len(urgent))
    drawing.hold(held=True)
    gate.set()
    drawing.submit(done.append, "submitted").result(10.0)
    assert done == ["submitted"]
    if goes_on == "it is urgent":
        urgent.append(True)
    elif goes_on == "all ends":
        drawing.finish_without_what_is_put_off()
    else:
        drawing.hold(held=False)
    await_that(lambda: done == ["submitted", "put off"])


def test_a_failure_of_other_work_does_not_reach_the_piece_that_gave_way(
    drawing: DrawingThread,
) -> None:
    done: list[str] = []
    gate = put_off_in_pieces(drawing, done)
    failing = drawing.submit(divmod, 1, 0)
    gate.set()
    with pytest.raises(ZeroDivisionError):
        failing.result(10.0)
    drawing.finish()
    assert done == ["put off"]
