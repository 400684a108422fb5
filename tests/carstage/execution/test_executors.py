"""Inline and local processes keep the rules of every executor."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from carstage.errors import BadInputError, StorageError, WorkerLostError
from carstage.execution import Executor, InlineExecutor, LocalProcesses, SlotEnd, SlotProgram
from carstage.execution.slots import LineBuffer, error_of
from carstage.testing.executor import ExecutorTests, ToyWork, toy_jobs


class TestInline(ExecutorTests):
    def executor(self, workers: int) -> Executor:
        del workers
        return InlineExecutor()

    def test_no_worker_is_opened_without_a_job(self, folder: Path) -> None:
        class NoWorker(ToyWork):
            def open_worker(self) -> Any:
                raise AssertionError("a server would start for nothing")

        self.run(NoWorker([], folder))


class TestLocalProcesses(ExecutorTests):
    def executor(self, workers: int) -> Executor:
        return LocalProcesses(workers)

    def test_a_job_that_always_kills_its_worker_leaves_the_others_in_peace(
        self, folder: Path
    ) -> None:
        class Deadly(ToyWork):
            def lost(self, slot: int, jobs: Any, end: SlotEnd, *, blame: bool) -> None:
                (folder / "began-1").unlink(missing_ok=True)  # it kills the next one, too
                super().lost(slot, jobs, end, blame=blame)

        work = Deadly(toy_jobs("square", "die", "square", "square"), folder)
        self.run(work)
        assert work.results == {"0": 0, "2": 4, "3": 9}
        assert work.given_up == ["1"]

    def test_a_worker_that_cannot_start_is_given_up_after_three_tries(self, folder: Path) -> None:
        class Broken(ToyWork):
            def program(self, slot: int) -> SlotProgram:
                return SlotProgram("carstage.no_such_module", {}, folder / f"{slot}.log")

        work = Broken(toy_jobs("square"), folder)
        with pytest.raises(WorkerLostError, match=r"no_such_module.*3 times in a row"):
            self.run(work, workers=1)
        assert len(work.lost_slots) == 3


def test_fewer_than_one_worker_is_refused() -> None:
    with pytest.raises(BadInputError, match="0 is not a number of workers"):
        LocalProcesses(0)


def test_a_line_may_come_in_pieces_and_must_be_a_message() -> None:
    buffer = LineBuffer()
    assert buffer.messages(b'{"say": "wa') == []
    assert buffer.messages(b'nt"}\n{"say": "done"}\n{') == [{"say": "want"}, {"say": "done"}]
    with pytest.raises(WorkerLostError, match="no message"):
        buffer.messages(b"oops\n")


def test_an_error_comes_over_the_line_with_its_type() -> None:
    error = error_of({"kind": "StorageError", "message": "It is full.", "hint": "Make room."})
    assert isinstance(error, StorageError)
    assert str(error) == "It is full. Make room."
    assert str(error_of({"kind": "os", "message": "What?"})) == "What?"
