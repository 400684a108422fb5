"""What every ``Executor`` must do; subclass ``ExecutorTests`` in a test module and give it one."""

# ruff: noqa: D102 (the name of a test states its rule)

from __future__ import annotations

import math
import os
import time
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import pytest

from carstage.errors import DiskFullError, ServerError
from carstage.execution import Executor, SlotEnd, SlotProgram
from carstage.testing.toy_worker import do

ToyJob = dict[str, str]
_PATIENCE_S = 120.0
_MOST_TRIES = 3


def toy_jobs(*what: str) -> list[ToyJob]:
    """Jobs with the keys 0, 1, …"""
    return [{"key": str(key), "do": name} for key, name in enumerate(what)]


class ToyWork:
    """Jobs of :mod:`carstage.testing.toy_worker`, for executors of either kind.

    Args:
        jobs: what is to be done.
        folder: for the workers.
        interrupt_at: the user ends the run once so many jobs have begun; None: never.
    """

    def __init__(self, jobs: list[ToyJob], folder: Path, interrupt_at: int | None = None) -> None:
        self._jobs = deque(jobs)
        self._folder = folder
        self._interrupt_at = interrupt_at
        self._never_readable = os.eventfd(0, os.EFD_CLOEXEC)
        self._deadline_s = time.monotonic() + _PATIENCE_S
        self._tries = Counter[str]()
        self.results: dict[str, int] = {}
        self.given = Counter[str]()
        self.begun: list[str] = []
        self.pids: set[int] = set()
        self.lost_slots: list[tuple[int, bool, str]] = []
        self.given_up: list[str] = []

    def close(self) -> None:
        """Give the descriptor back."""
        os.close(self._never_readable)

    # For executors that work in this process.

    @contextmanager
    def open_worker(self) -> Iterator[ToyWork]:
        """Itself: it does the jobs."""
        yield self

    def record(self, job: ToyJob) -> None:
        """Do a job here."""
        self.begun.append(job["key"])
        self.poll()
        self.results[job["key"]] = do(job, self._folder)

    # For executors with slots.

    @property
    def left(self) -> int:
        """See ``SlotWork.left``."""
        return len(self._jobs)

    @property
    def left_s(self) -> float:
        """See ``SlotWork.left_s``."""
        return math.inf

    def fileno(self) -> int:
        """See ``SlotWork.fileno``."""
        return self._never_readable

    def poll(self) -> None:
        """See ``SlotWork.poll``."""
        assert time.monotonic() < self._deadline_s, "the jobs are not done in time"
        if self._interrupt_at is not None and len(self.begun) >= self._interrupt_at:
            raise KeyboardInterrupt

    def take(self) -> ToyJob | None:
        """See ``SlotWork.take``."""
        if not self._jobs:
            return None
        job = self._jobs.popleft()
        self.given[job["key"]] += 1
        return job

    def key(self, job: ToyJob) -> str:
        """See ``SlotWork.key``."""
        return job["key"]

    def describe(self, job: ToyJob) -> Mapping[str, Any]:
        """See ``SlotWork.describe``."""
        return job

    def program(self, slot: int) -> SlotProgram:
        """See ``SlotWork.program``."""
        return SlotProgram(
            module="carstage.testing.toy_worker",
            setup={"folder": str(self._folder)},
            log_path=self._folder / f"worker-{slot}.log",
            environment={"CARSTAGE_TOY": str(slot)},
        )

    def on_message(self, slot: int, message: Mapping[str, Any]) -> None:
        """See ``SlotWork.heard``."""
        del slot
        if message["say"] == "here":
            self.pids.add(int(message["pid"]))
        elif message["say"] == "began":
            self.begun.append(str(message["key"]))
        elif message["say"] == "result":
            assert message["key"] not in self.results, "a job is done once"
            self.results[str(message["key"])] = int(message["value"])

    def lost(self, slot: int, jobs: list[ToyJob], end: SlotEnd, *, blame: bool) -> None:
        """See ``SlotWork.lost``."""
        self.lost_slots.append((slot, blame, end.reason))
        for job in jobs:
            self._tries[job["key"]] += blame
            if self._tries[job["key"]] < _MOST_TRIES:
                self._jobs.appendleft(job)
            else:
                self.given_up.append(job["key"])


class ExecutorTests:
    """The contract of an executor, as tests.

    Override ``executor`` to give one with as many workers.
    """

    def executor(self, workers: int) -> Executor:
        """An executor with so many workers, at most."""
        raise NotImplementedError

    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        """A folder that all workers see."""
        return tmp_path

    def run(self, work: ToyWork, workers: int = 2) -> None:
        """Do the work; no worker is left then."""
        try:
            executor = self.executor(workers)
            with executor.opened():
                executor.execute(work)
        finally:
            work.close()
            alive = [pid for pid in work.pids if psutil.pid_exists(pid)]
            assert alive == [], "a worker outlives its run"

    def skip_in_process(self) -> None:
        """Skip what cannot happen to a worker in this process."""
        if self.executor(1).in_process:
            pytest.skip("the worker is this process")

    def test_every_job_is_done_once(self, folder: Path) -> None:
        work = ToyWork(toy_jobs(*["square"] * 7), folder)
        self.run(work)
        assert work.results == {str(n): n * n for n in range(7)}
        assert set(work.given.values()) == {1}

    def test_no_jobs_open_no_worker(self, folder: Path) -> None:
        work = ToyWork([], folder)
        self.run(work)
        assert work.pids == set()

    def test_results_depend_neither_on_order_nor_on_workers(self, folder: Path) -> None:
        jobs = toy_jobs(*["square"] * 5)
        one, other = ToyWork(jobs, folder), ToyWork(jobs[::-1], folder)
        self.run(one, workers=1)
        self.run(other, workers=3)
        assert one.results == other.results

    def test_a_dying_workers_job_is_done_by_another(self, folder: Path) -> None:
        self.skip_in_process()
        work = ToyWork(toy_jobs("square", "die", "square", "die", "square"), folder)
        self.run(work)
        assert work.results == {str(n): n * n for n in range(5)}
        assert work.given == {"0": 1, "1": 2, "2": 1, "3": 2, "4": 1}
        assert sum(blame for _, blame, _ in work.lost_slots) == 2

    def test_a_place_without_a_server_is_left_and_its_job_done_elsewhere(
        self, folder: Path
    ) -> None:
        self.skip_in_process()
        work = ToyWork(toy_jobs("no_server", *["square"] * 4), folder)
        self.run(work)
        assert work.results == {str(n): n * n for n in range(5)}
        assert not any(blame for _, blame, _ in work.lost_slots)

    def test_without_a_server_anywhere_the_run_ends(self, folder: Path) -> None:
        work = ToyWork(toy_jobs(*["no_server"] * 5), folder)
        with pytest.raises(ServerError, match="no server here"):
            self.run(work)

    def test_an_error_that_ends_the_run_ends_all_workers(self, folder: Path) -> None:
        work = ToyWork(toy_jobs("square", "fail", "square"), folder)
        with pytest.raises(DiskFullError, match=r"no space left\. Make room"):
            self.run(work)

    def test_interrupting_ends_all_workers(self, folder: Path) -> None:
        self.skip_in_process()
        work = ToyWork(toy_jobs(*["wait"] * 4), folder, interrupt_at=2)
        with pytest.raises(KeyboardInterrupt):
            self.run(work)
        assert work.results == {}
        assert len(work.pids) == 2
