"""Threads that share work: every part is taken once, errors come back, threads may be shared."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from carstage_sim.kernels import kernel
from carstage_sim.render.caster import Packets, RayCaster
from carstage_sim.render.sharing import OfEachThread, Team, parts_of, take


@pytest.fixture
def caster() -> Iterator[RayCaster]:
    one = RayCaster(4)
    yield one
    one.close()


@kernel
def _count_taken(parts, taken):  # type: ignore[no-untyped-def]
    first, last = take(parts)
    while first < last:
        for number in range(first, last):
            taken[number] += 1
        first, last = take(parts)


def test_kernels_in_several_threads_take_every_part_once() -> None:
    taken, parts = np.zeros(100_003, np.int64), parts_of(100_003, 7)
    team = Team(4, "test")
    team.do(lambda: _count_taken(parts, taken), 4)
    team.close()
    assert (taken == 1).all()


@pytest.mark.parametrize("count", [0, 1, 5, 6, 1000])
def test_bands_cover_a_range_once(caster: RayCaster, count: int) -> None:
    taken = np.zeros(count, np.int64)

    def work(first: int, last: int) -> None:
        taken[first:last] += 1

    caster.in_bands(count, work, 5)
    assert (taken == 1).all()


@pytest.mark.parametrize("count", [0, 1, 17, 5000])
def test_in_pieces_every_part_is_taken_once_and_others_come_in_between(
    caster: RayCaster, count: int
) -> None:
    order = np.arange(count, dtype=np.int32)
    packets = Packets(order, np.arange(count + 1, dtype=np.int32))
    taken, seen, others = np.zeros(count, np.int64), [], np.zeros(count, np.int64)

    def between() -> None:
        seen.append(int(taken.sum()))
        with caster.in_pieces(None):
            caster.in_packets(packets, lambda parts: _count_taken(parts, others))

    with caster.in_pieces(between):
        caster.in_packets(packets, lambda parts: _count_taken(parts, taken))
    assert (taken == 1).all()
    assert (others == len(seen)).all()
    assert seen == sorted(seen)
    assert len(seen) <= 16
    assert len(seen) == 16 or count < 5000
    calls = len(seen)
    caster.in_packets(packets, lambda parts: _count_taken(parts, taken))
    assert len(seen) == calls
    assert (taken == 2).all()


def test_several_callers_share_the_threads(caster: RayCaster) -> None:
    together = threading.Barrier(3)
    sums: list[int] = []

    def ask() -> None:
        found: list[int] = []
        together.wait(10.0)
        caster.in_bands(200, lambda first, last: found.extend(range(first, last)), 3)
        sums.append(sum(found))

    callers = [threading.Thread(target=ask) for _ in range(3)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert sums == [sum(range(200))] * 3


def test_who_joins_does_not_wait_for_threads_that_are_busy_elsewhere() -> None:
    team, free = Team(2, "test"), threading.Event()
    busy = threading.Barrier(3)
    done: list[int] = []
    in_time: list[bool] = []

    def occupy() -> None:
        busy.wait(10.0)
        in_time.append(free.wait(10.0))

    other = threading.Thread(target=lambda: team.do(occupy, 2))
    other.start()
    busy.wait(10.0)
    left = iter(range(5))
    team.do(lambda: done.extend(left), 5, joined=True)
    free.set()
    other.join()
    assert in_time == [True, True], "it came back while they were busy"
    team.do(lambda: done.append(5), 2)  # the threads go on, and begin nothing that is over
    team.close()
    assert done[:5] == list(range(5))
    assert set(done[5:]) == {5}


def test_an_error_of_a_thread_is_raised_and_the_threads_work_on(caster: RayCaster) -> None:
    def fail(first: int, last: int) -> None:
        if first == 50:
            raise ValueError("band 50")

    with pytest.raises(ValueError, match="band 50"):
        caster.in_bands(100, fail, 10)
    done: list[int] = []
    caster.in_bands(100, lambda first, last: done.append(first), 10)
    assert sorted(done) == list(range(0, 100, 10))


def test_each_thread_has_its_own(caster: RayCaster) -> None:
    own = OfEachThread(lambda: threading.get_ident())
    assert own() == threading.get_ident()
    seen: list[tuple[int, int]] = []
    caster.in_bands(64, lambda first, last: seen.append((own(), threading.get_ident())), 1)
    assert all(made == ident for made, ident in seen)
