"""Work that one thread hands to another, or does itself while that has nothing to do."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from functools import partial

import pytest

from carstage_sim.work_thread import WorkThread
from waiting import await_that


@pytest.fixture
def worker() -> Iterator[WorkThread]:
    thread = WorkThread("work")
    yield thread
    thread.close()


def test_work_is_done_in_order_in_one_other_thread(worker: WorkThread) -> None:
    done: list[tuple[int, str]] = []

    def work(number: int) -> None:
        done.append((number, threading.current_thread().name))

    for number in range(200):
        worker.submit(work, number)
    worker.finish()
    assert [number for number, _ in done] == list(range(200))
    (name,) = {name for _, name in done}
    assert name != threading.current_thread().name
    assert not worker.busy


def test_work_is_done_here_unless_the_thread_is_busy(worker: WorkThread) -> None:
    here = threading.get_ident()
    assert worker.at_once_or_later(threading.get_ident).result(0) == here
    gate = threading.Event()
    worker.submit(gate.wait)
    await_that(lambda: worker.busy)
    later = worker.at_once_or_later(threading.get_ident)
    assert not later.done()
    gate.set()
    assert later.result(10.0) != here


def test_an_error_is_raised_where_the_result_is_asked_for(worker: WorkThread) -> None:
    with pytest.raises(ZeroDivisionError):
        worker.at_once_or_later(divmod, 1, 0).result()
    with pytest.raises(ZeroDivisionError):
        worker.submit(divmod, 1, 0).result()
    worker.finish()
    assert not worker.busy


def test_far_too_much_work_makes_who_hands_it_over_wait(worker: WorkThread) -> None:
    gate, handed = threading.Event(), []

    def hand_over() -> None:
        for number in range(1000):
            worker.submit(gate.wait)
            handed.append(number)

    thread = threading.Thread(target=hand_over)
    thread.start()
    await_that(lambda: len(handed) >= 64)
    assert len(handed) < 1000
    gate.set()
    thread.join()
    assert len(handed) == 1000


def test_the_rest_of_work_goes_on_beside_what_is_begun_next_and_nothing_else(
    worker: WorkThread,
) -> None:
    done: list[str] = []
    rests = [Future[None]() for _ in range(3)]

    def begin(number: int) -> Future[None]:
        done.append(f"begun {number}")
        return rests[number]

    begun = [worker.begin(partial(begin, number)) for number in range(3)]
    begun[1].handed_out.result(10.0)
    assert done == ["begun 0", "begun 1"]  # two are under way, the third waits for the first
    assert not any(one.done.done() for one in begun)
    assert worker.busy
    rests[0].set_result(None)
    begun[2].handed_out.result(10.0)
    submitted = worker.submit(done.append, "submitted")
    worker.put_off(partial(done.append, "put off"))
    rests[1].set_result(None)
    begun[1].done.result(10.0)
    assert not submitted.done()
    rests[2].set_exception(KeyError("the third"))
    worker.finish()
    assert done == ["begun 0", "begun 1", "begun 2", "submitted", "put off"]
    with pytest.raises(KeyError, match="the third"):
        begun[2].done.result(0)
    assert not worker.busy


def test_work_that_cannot_begin_leaves_no_rest(worker: WorkThread) -> None:
    def fail() -> Future[None]:
        raise ValueError("at once")

    begun = worker.begin(fail)
    with pytest.raises(ValueError, match="at once"):
        begun.done.result(10.0)
    assert begun.handed_out.done()
    assert worker.submit(lambda: 1).result(10.0) == 1


def test_a_piece_goes_on_when_the_rest_of_what_came_in_between_is_done(
    worker: WorkThread,
) -> None:
    done: list[str] = []
    rest = Future[None]()
    came = threading.Event()

    def in_pieces() -> None:
        came.set()
        await_that(lambda: bool(begun))
        worker.give_way()
        done.append(f"goes on, {rest.done()}")

    begun: list[object] = []
    worker.put_off(in_pieces)
    assert came.wait(10.0)
    one = worker.begin(lambda: rest)
    begun.append(one)
    one.handed_out.result(10.0)
    rest.set_result(None)
    worker.finish()
    assert done == ["goes on, True"]


def put_off_behind_a_gate(worker: WorkThread, work: Callable[[], None]) -> threading.Event:
    """Put work off and wait until it is begun; it is done when the gate is set."""
    gate, began = threading.Event(), threading.Event()

    def gated() -> None:
        began.set()
        gate.wait()
        work()

    worker.put_off(gated)
    assert began.wait(10.0)
    return gate


def test_what_is_put_off_comes_after_all_else_that_waits_one_piece_at_a_time(
    worker: WorkThread,
) -> None:
    done: list[str] = []
    gate = put_off_behind_a_gate(worker, partial(done.append, "put off 0"))
    for number in (1, 2):
        worker.put_off(partial(done.append, f"put off {number}"))
    for number in range(3):
        worker.submit(done.append, f"submitted {number}")
    assert worker.busy
    gate.set()
    worker.finish()
    submitted = [f"submitted {number}" for number in range(3)]
    assert done == ["put off 0", *submitted, "put off 1", "put off 2"]
    assert not worker.busy


def test_what_is_put_off_may_fail_and_the_rest_is_done(worker: WorkThread) -> None:
    done: list[int] = []
    worker.put_off(lambda: done.append(1 // 0))
    worker.put_off(partial(done.append, 1))
    worker.finish()
    assert done == [1]


def test_at_the_end_what_is_put_off_and_not_begun_is_left_out(worker: WorkThread) -> None:
    done: list[int] = []
    gate = put_off_behind_a_gate(worker, partial(done.append, 0))
    worker.put_off(partial(done.append, 1))
    ending = threading.Thread(target=worker.finish_without_what_is_put_off)
    ending.start()
    gate.set()
    ending.join()
    assert done == [0]
    worker.put_off(partial(done.append, 2))
    worker.finish()
    assert done == [0, 2]


def test_while_held_nothing_that_is_put_off_is_begun_though_it_was_queued(
    worker: WorkThread,
) -> None:
    done: list[str] = []
    gate = put_off_behind_a_gate(worker, partial(done.append, "put off 0"))
    worker.put_off(partial(done.append, "put off 1"))
    worker.submit(partial(worker.hold, held=True))  # after the second was queued
    gate.set()
    worker.submit(done.append, "submitted").result(10.0)
    worker.submit(done.append, "submitted").result(10.0)
    assert done == ["put off 0", "submitted", "submitted"]
    assert worker.busy
    worker.hold(held=False)
    worker.finish()
    assert done[3:] == ["put off 1"]


@pytest.mark.parametrize("finish", ["finish", "finish_without_what_is_put_off"])
def test_who_waits_for_the_end_does_not_wait_for_what_is_held(
    worker: WorkThread, finish: str
) -> None:
    done: list[int] = []
    worker.hold(held=True)
    worker.put_off(partial(done.append, 1))
    getattr(worker, finish)()
    assert done == ([1] if finish == "finish" else [])
    assert not worker.busy


def test_what_is_urgent_comes_first_of_what_is_put_off_held_or_not(worker: WorkThread) -> None:
    done: list[str] = []
    gate = threading.Event()
    worker.hold(held=True)
    worker.submit(gate.wait)
    for name, urgency in {"first": 0, "many 1": 1, "read 1": 2, "many 2": 1, "read 2": 2}.items():
        line = name.split(maxsplit=1)[0]
        worker.put_off(partial(done.append, name), line, lambda urgency=urgency: urgency)
    gate.set()
    await_that(lambda: len(done) == 4)
    worker.finish()
    assert done == ["read 1", "read 2", "many 1", "many 2", "first"]


def test_pieces_of_a_line_keep_their_order_while_one_of_them_becomes_urgent(
    worker: WorkThread,
) -> None:
    done: list[str] = []
    asked = iter(range(10))
    gate = put_off_in_pieces(worker, done, lambda: next(asked))
    worker.put_off(partial(done.append, "same line"), "line", lambda: 99)
    worker.put_off(partial(done.append, "other line"), "other", lambda: 100)
    gate.set()
    worker.finish()
    assert done == ["other line", "put off", "same line"]


def test_who_put_off_what_is_left_out_hears_of_it(worker: WorkThread) -> None:
    done: list[str] = []
    worker.hold(held=True)
    worker.put_off(partial(done.append, "done"), leave_out=partial(done.append, "left out"))
    worker.finish_without_what_is_put_off()
    assert done == ["left out"]


def put_off_in_pieces(
    worker: WorkThread, done: list[str], urgency: Callable[[], int] = lambda: 0
) -> threading.Event:
    """Put work off that gives way when the gate is set, and wait until it is begun."""
    gate, began = threading.Event(), threading.Event()

    def in_pieces() -> None:
        began.set()
        gate.wait()
        worker.give_way()
        done.append("put off")

    worker.put_off(in_pieces, "line", urgency)
    assert began.wait(10.0)
    return gate


def test_other_work_is_done_while_a_piece_that_is_put_off_gives_way(
    worker: WorkThread,
) -> None:
    done: list[str] = []
    gate = put_off_in_pieces(worker, done)

    def submitted() -> None:
        worker.give_way()  # which does nothing in other work
        done.append("submitted")

    for _ in range(2):
        worker.submit(submitted)
    gate.set()
    worker.finish()
    assert done == ["submitted", "submitted", "put off"]
    assert not worker.busy


@pytest.mark.parametrize("goes_on", ["it is urgent", "it is not held any more", "all ends"])
def test_a_piece_that_gives_way_while_held_goes_on_when(worker: WorkThread, goes_on: str) -> None:
    done: list[str] = []
    urgent: list[bool] = []
    gate = put_off_in_pieces(worker, done, lambda: len(urgent))
    worker.hold(held=True)
    gate.set()
    worker.submit(done.append, "submitted").result(10.0)
    assert done == ["submitted"]
    if goes_on == "it is urgent":
        urgent.append(True)
    elif goes_on == "all ends":
        worker.finish_without_what_is_put_off()
    else:
        worker.hold(held=False)
    await_that(lambda: done == ["submitted", "put off"])


def test_a_failure_of_other_work_does_not_reach_the_piece_that_gave_way(
    worker: WorkThread,
) -> None:
    done: list[str] = []
    gate = put_off_in_pieces(worker, done)
    failing = worker.submit(divmod, 1, 0)
    gate.set()
    with pytest.raises(ZeroDivisionError):
        failing.result(10.0)
    worker.finish()
    assert done == ["put off"]
