"""Work that one thread hands to another, or does itself while that has nothing to do."""

from __future__ import annotations

import threading
from collections.abc import Iterator

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
