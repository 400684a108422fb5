"""The seam between a run and the machines it uses.

A **worker** is one server with the collector that records on it. An executor lets workers take one
job (an episode) after the other until none is left. There are three: one worker in this process
(:class:`InlineExecutor`), several processes on this machine (``local_processes``), and actors of a
Ray cluster (``ray_slots``). The last two open **slots**, each a process that is a worker: see
``slots``. ``carstage.testing.executor`` holds the rules that all of them keep.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Any, ClassVar, Protocol, TypeVar

Job = TypeVar("Job")
JobIn = TypeVar("JobIn", contravariant=True)


class Worker(Protocol[JobIn]):
    """One server and its collector."""

    def record(self, job: JobIn) -> None:
        """Record one episode and report its fate to the run; raises only what ends the run."""


class InlineWork(Protocol[Job]):
    """Jobs that are done in this process."""

    def take(self) -> Job | None:
        """The next job; waits for one that may have to be repeated; None: none is left.

        Raises:
            KeyboardInterrupt: the user ended the run.
        """

    def open_worker(self) -> AbstractContextManager[Worker[Job]]:
        """A worker, which gives everything back on leaving the context."""


class Executor(Protocol):
    """Spreads jobs over workers.

    Every job is done once; one whose worker died is done by another. The order of the jobs and the
    number of workers change nothing in what is recorded. When ``execute`` returns or raises, no
    worker is left.
    """

    in_process: ClassVar[bool]
    """Whether it takes an ``InlineWork``; else it takes a ``slots.SlotWork``."""
    count: int
    """How many workers there are at most; known while it is opened."""

    @property
    def cores_per_worker(self) -> int | None:
        """Cores of each worker; None: a share of this machine."""

    def opened(self) -> AbstractContextManager[None]:
        """A stretch in which it may ``execute``.

        Raises:
            BadInputError: what it needs is not there.
        """

    def execute(self, work: Any) -> None:
        """Do every job of ``work``.

        Raises:
            KeyboardInterrupt: the work's own, once all workers have ended.
            CarStageError: what ended the run, in a worker or here.
        """


class InlineExecutor:
    """One worker, one episode after the other."""

    in_process: ClassVar[bool] = True
    count = 1

    @property
    def cores_per_worker(self) -> None:
        """All of this machine's, as far as the server takes them."""
        return None

    def opened(self) -> AbstractContextManager[None]:
        """See ``Executor.opened``."""
        return nullcontext()

    def execute(self, work: InlineWork[Any]) -> None:
        """See ``Executor.execute``."""
        job = work.take()
        if job is None:
            return
        with work.open_worker() as worker:
            while job is not None:
                worker.record(job)
                job = work.take()
