"""Threads that share work: every part is taken once, threads may be shared."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.caster import Packets, RayCaster, usual_threads
from carstage_sim.render.crew import CALLS, Crew, add, do, do_step, for_workers, load
from driving import wait_for


@pytest.fixture
def caster() -> Iterator[RayCaster]:
    one = RayCaster(4)
    yield one
    one.close()


@pytest.mark.parametrize(("cores", "threads"), [(1, 1), (2, 2), (7, 7), (8, 7), (16, 15)])
def test_of_many_cores_one_is_left_to_python_and_to_clients(
    monkeypatch: pytest.MonkeyPatch, cores: int, threads: int
) -> None:
    monkeypatch.setattr(
        "carstage_sim.render.caster.os.sched_getaffinity", lambda _: set(range(cores))
    )
    assert usual_threads() == threads


@device
def _count_part(taken, done_by, worker, first, last):  # type: ignore[no-untyped-def]
    for number in range(first, last):
        taken[number] += 1
        done_by[number] = worker


@kernel
def _count_taken(data, board, job, work):  # type: ignore[no-untyped-def]
    do(_count_part, data, board, job, work)


def counted(crew: Crew, first: int, count: int, size: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """How often each of some items was done, and by which thread."""
    taken, done_by = np.zeros(count, np.int64), np.full(count, -1, np.int64)
    with crew.job(first, count, size) as (job, work):
        _count_taken((taken, done_by), crew.board, job, work)
    return taken, done_by


@pytest.fixture
def crew() -> Iterator[Crew]:
    one = Crew(4, "test")
    yield one
    one.close()


@pytest.mark.parametrize("threads", [1, 2, 4])
@pytest.mark.parametrize(
    ("first", "count", "size"), [(0, 100_003, 7), (5, 6, 1), (0, 0, 4), (9, 9, 2)]
)
def test_a_crew_does_every_item_once(threads: int, first: int, count: int, size: int) -> None:
    crew = Crew(threads, "test")
    taken, done_by = counted(crew, first, count, size)
    crew.close()
    assert (taken[first:] == 1).all()
    assert not taken[:first].any()
    assert set(done_by[first:].tolist()) <= set(range(threads))


def test_items_of_a_part_are_done_by_one_thread(crew: Crew) -> None:
    _, done_by = counted(crew, 0, 1000, 10)
    assert (done_by.reshape(100, 10) == done_by[::10, None]).all()


def test_without_threads_callers_do_their_jobs_one_after_the_other() -> None:
    """They share the memory of one thread."""
    crew, inside, most = Crew(1, "test"), [], []

    def ask() -> None:
        for _ in range(50):
            with crew.job(0, 1, 1):
                inside.append(1)
                most.append(len(inside))
                inside.pop()

    callers = [threading.Thread(target=ask) for _ in range(8)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert set(most) == {1}
    assert len(most) == 400


def test_many_jobs_of_several_callers_are_all_done(crew: Crew) -> None:
    """More callers than rows of the board, and rows that are used again at once."""
    wrong: list[int] = []

    def ask(caller: int) -> None:
        for turn in range(300):
            with crew.ranked(caller % 3):
                taken, _ = counted(crew, 0, 1 + (turn * 7 + caller) % 97, 1 + turn % 5)
            wrong.append(int((taken != 1).sum()))

    callers = [threading.Thread(target=ask, args=(number,)) for number in range(20)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert len(wrong) == 6000
    assert not any(wrong)


@device
def _next_part(before, after, reach, worker, first, last):  # type: ignore[no-untyped-def]
    for number in range(first, last):
        after[number] = before[(number + reach) % len(before)] + 1


@kernel
def _in_steps(data, board, job, work):  # type: ignore[no-untyped-def]
    one, other, reach = data
    do(_next_part, (one, other, reach), board, job, work)
    for _ in range(2):
        do_step(_next_part, (other, one, reach), board, job, work, 1, len(one), 3)
        do_step(_next_part, (one, other, reach), board, job, work, 2, len(one), 5)


def test_steps_of_one_call_begin_when_those_before_are_done(crew: Crew) -> None:
    """Each reads what others of the step before wrote; many callers use the rows in turn."""
    wrong: list[int] = []

    def ask(count: int) -> None:
        for turn in range(200):
            one, other = np.zeros(count, np.int64), np.zeros(count, np.int64)
            with crew.job(0, count, 2) as (job, work):
                _in_steps((one, other, turn), crew.board, job, work)
            wrong.append(int((one != 4).sum() + (other != 5).sum()))

    callers = [threading.Thread(target=ask, args=(number,)) for number in range(60, 80)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert len(wrong) == 4000
    assert not any(wrong)


@device
def _wait_part(gates, order, place, mark, worker, first, last):  # type: ignore[no-untyped-def]
    while first < len(gates) and not load(gates, first):
        pass
    order[add(place, 0, 1)] = mark


@kernel
def _wait(data, board, job, work):  # type: ignore[no-untyped-def]
    do(_wait_part, data, board, job, work)


def test_the_lowest_rank_comes_first_whoever_asked_first() -> None:
    crew, order, place = Crew(2, "test"), np.zeros(8, np.int64), np.zeros(1, np.int64)
    gates, none = np.zeros(2, np.int64), np.zeros(0, np.int64)

    def ask(rank: int, gates: NDArray[np.int64], count: int) -> None:
        with crew.ranked(rank), crew.job(0, count, 1) as (job, work):
            _wait((gates, order, place, rank), crew.board, job, work)

    asked = [(0, gates, 2), (2, none, 3), (1, none, 3)]
    callers = [threading.Thread(target=ask, args=one) for one in asked]
    for number, caller in enumerate(callers):
        caller.start()
        wait_for(lambda number=number: crew.board[CALLS] > number, "the job on the board")
    gates[1] = 1  # one of the two threads is free now
    wait_for(lambda: place[0] == 7, "all jobs of one thread")
    gates[0] = 1
    for caller in callers:
        caller.join()
    crew.close()
    assert order.tolist() == [0, 1, 1, 1, 2, 2, 2, 0]


def test_what_threads_write_to_is_apart(crew: Crew) -> None:
    class Memory(NamedTuple):
        few: NDArray[np.int32]
        many: NDArray[np.float32]

    memory = for_workers(crew, Memory(np.zeros(1, np.int32), np.zeros((5, 100), np.float32)))
    for one, needed in ((memory.few, (1,)), (memory.many, (5, 100))):
        assert len(one) == 4
        assert all(there >= wanted for there, wanted in zip(one.shape[1:], needed, strict=True))
        assert one.strides[0] - int(np.prod(needed)) * one.itemsize >= 128


@pytest.mark.parametrize("count", [0, 1, 17, 5000])
def test_in_pieces_every_part_is_taken_once_and_others_come_in_between(
    caster: RayCaster, count: int
) -> None:
    order = np.arange(count, dtype=np.int32)
    packets = Packets(order, np.arange(count + 1, dtype=np.int32))
    taken, seen, others = np.zeros(count, np.int64), [], np.zeros(count, np.int64)
    by = np.zeros(count, np.int64)

    def between() -> None:
        seen.append(int(taken.sum()))
        with caster.in_pieces(None):
            caster.in_packets(_count_taken, (others, by), packets)

    with caster.in_pieces(between):
        caster.in_packets(_count_taken, (taken, by), packets)
    assert (taken == 1).all()
    assert (others == len(seen)).all()
    assert seen == sorted(seen)
    assert len(seen) <= 16
    assert len(seen) == 16 or count < 5000
    calls = len(seen)
    caster.in_packets(_count_taken, (taken, by), packets)
    assert len(seen) == calls
    assert (taken == 2).all()
