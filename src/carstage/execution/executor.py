"""The seam between a run and the machines it uses.

A **lane** is one server with the collector that records on it. An executor opens lanes and lets
each take one episode after the other until none is left. Here: one lane, in this process. Several
local lanes, or lanes on other machines, are further executors.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol, TypeVar

Job = TypeVar("Job")
JobIn = TypeVar("JobIn", contravariant=True)


class Lane(Protocol[JobIn]):
    """One server and its collector."""

    def record(self, job: JobIn) -> None:
        """Record one episode and report its fate to the run; raises only what ends the run."""


class Executor(Protocol):
    """Spreads episodes over lanes."""

    def execute(
        self,
        take: Callable[[], Job | None],
        open_lane: Callable[[], AbstractContextManager[Lane[Job]]],
    ) -> None:
        """Record every job that ``take`` gives, until it gives None.

        Args:
            take: the next job; may wait for one that has to be repeated.
            open_lane: a lane, which gives everything back on leaving the context.
        """


class InlineExecutor:
    """One lane, one episode after the other."""

    def execute(
        self,
        take: Callable[[], Job | None],
        open_lane: Callable[[], AbstractContextManager[Lane[Job]]],
    ) -> None:
        """See ``Executor.execute``."""
        job = take()
        if job is None:
            return
        with open_lane() as lane:
            while job is not None:
                lane.record(job)
                job = take()
