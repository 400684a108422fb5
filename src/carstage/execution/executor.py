"""The seam between a run and the machines it uses.

A **worker** is one server with the collector that records on it. An executor opens workers and lets
each take one episode after the other until none is left. Here: one worker, in this process. Several
local workers, or workers on other machines, are further executors.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol, TypeVar

Job = TypeVar("Job")
JobIn = TypeVar("JobIn", contravariant=True)


class Worker(Protocol[JobIn]):
    """One server and its collector."""

    def record(self, job: JobIn) -> None:
        """Record one episode and report its fate to the run; raises only what ends the run."""


class Executor(Protocol):
    """Spreads episodes over workers."""

    def execute(
        self,
        take: Callable[[], Job | None],
        open_worker: Callable[[], AbstractContextManager[Worker[Job]]],
    ) -> None:
        """Record every job that ``take`` gives, until it gives None.

        Args:
            take: the next job; may wait for one that has to be repeated.
            open_worker: a worker, which gives everything back on leaving the context.
        """


class InlineExecutor:
    """One worker, one episode after the other."""

    def execute(
        self,
        take: Callable[[], Job | None],
        open_worker: Callable[[], AbstractContextManager[Worker[Job]]],
    ) -> None:
        """See ``Executor.execute``."""
        job = take()
        if job is None:
            return
        with open_worker() as worker:
            while job is not None:
                worker.record(job)
                job = take()
