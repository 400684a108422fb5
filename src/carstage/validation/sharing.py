"""A dataset's episodes as tasks, and the processes that share them."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice

from carstage.dataset.reading import Episode
from carstage.errors import CarStageError, WorkerLostError
from carstage.lazy import keep_pandas_lazy
from carstage.processes import ProcessPool, process_pool
from carstage.storage.marker import CommitMarker
from carstage.storage.remote_path import DatasetPath
from carstage.validation.checks.episode import check_episode
from carstage.validation.checks.figures import FrameFigures, TableFigures
from carstage.validation.checks.files import Listing, list_files
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.frames import FrameChecks

FRAMES = 5
"""Of one task. Sums are rounded by it: it is the same for any number of processes."""
_FEWEST_TASKS = 8
"""From which on processes are started: they load libraries first."""
_JOBS_AHEAD = 4
"""For each process; what they found waits for what comes before it."""
_MOST_TASKS_OF_A_JOB = 24
"""Each job reads an episode's tables again, but the bar moves only when one is done."""
_MOST_THREADS = 4
"""More decode faster than one thread checks."""


@dataclass(frozen=True, slots=True)
class Task:
    """What one process looks at: an episode's documents and tables, or some of its frames.

    Attributes:
        folder: of the episode's attempt.
        marker: its commit marker.
        agent: whose view it is; None: the ego's.
        frames: first frame, and the one after the last; None: documents and tables.
    """

    folder: DatasetPath
    marker: CommitMarker
    agent: str | None
    frames: tuple[int, int] | None = None

    def is_of(self, episode: Episode) -> bool:
        """Whether it looks at that one."""
        of = episode.marker
        mine = self.marker.episode_id, self.marker.attempt, self.agent
        return mine == (of.episode_id, of.attempt, episode.agent_name)


@dataclass(slots=True)
class Checked:
    """What a task found.

    Attributes:
        findings: the problems.
        tables, frames: what was measured, in one or the other.
        unreadable: why nothing can be said.
    """

    findings: Findings
    tables: TableFigures | None = None
    frames: FrameFigures | None = None
    unreadable: str | None = None


def tasks_of(view: Episode) -> Iterator[Task]:
    """The tasks of an episode: its documents and tables, then its frames in order."""
    whose = view.folder, view.marker, view.agent_name
    yield Task(*whose)
    for first in range(0, view.frames, FRAMES):
        yield Task(*whose, (first, min(first + FRAMES, view.frames)))


class Checker:
    """Does tasks one after the other; what it has read of an episode serves the next task of it.

    Args:
        threads: that read and decode.
    """

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._episode: Episode | None = None
        self._listing: Listing | None = None
        self._frames: FrameChecks | None = None

    def check(self, task: Task) -> Checked:
        """Do a task."""
        episode = self._episode
        if episode is None or not task.is_of(episode):
            episode = self._episode = Episode(task.folder, task.marker, task.agent)
            self._listing = self._frames = None
        findings = Findings(episode.id, episode.agent_name)
        try:
            if self._listing is None:
                self._listing = list_files(episode.folder)
            if task.frames is None:
                return Checked(findings, check_episode(episode, self._listing, findings))
            if self._frames is None:
                self._frames = FrameChecks(episode, self._listing, self._threads)
            return Checked(findings, frames=self._frames.check(*task.frames, findings))
        except CarStageError as error:
            return Checked(findings, unreadable=str(error))


def _alone(tasks: Iterable[Task]) -> Iterator[Checked]:
    """What tasks found, in their order, by this process when it is asked for."""
    checker = Checker(max(1, min(_MOST_THREADS, os.cpu_count() or 1)))
    return map(checker.check, tasks)


def _together(
    views: Sequence[Episode], size: int, pool: ProcessPool, ahead: int
) -> Iterator[Checked]:
    """What tasks found, in their order; the first jobs are begun at once.

    Args:
        views: the episodes.
        size: number of tasks of a job; all are of one episode.
        pool: does the jobs.
        ahead: number of jobs that are begun before what they found is asked for.
    """
    jobs = (job for view in views for job in _jobs_of(view, size))
    begun = deque(pool.submit(_check, job) for job in islice(jobs, ahead))

    def results() -> Iterator[Checked]:
        while begun:
            begun.extend(pool.submit(_check, job) for job in islice(jobs, 1))
            yield from begun.popleft().result()

    return results()


def _jobs_of(view: Episode, size: int) -> Iterator[tuple[Task, ...]]:
    tasks = tasks_of(view)
    while job := tuple(islice(tasks, size)):
        yield job


@contextmanager
def shared(views: Sequence[Episode], workers: int | None) -> Iterator[Iterator[Checked]]:
    """Processes at work on the tasks of episodes, one after the other; what each task found.

    Args:
        views: the episodes.
        workers: number of processes; 0: this one; None: as many as cores may be used, and this
            one alone for few tasks.

    Raises:
        WorkerLostError: a process died.
    """
    count = sum(1 + -(-view.frames // FRAMES) for view in views)
    if workers is None:
        workers = len(os.sched_getaffinity(0))
        workers = 0 if count < _FEWEST_TASKS or workers == 1 else workers
    workers = min(workers, count)
    if not workers:
        yield _alone(task for view in views for task in tasks_of(view))
        return
    ahead = _JOBS_AHEAD * workers
    size = max(1, min(_MOST_TASKS_OF_A_JOB, count // ahead))
    pool = process_pool(workers, preload=(_load, ()))
    try:
        yield _together(views, size, pool, ahead)
    except BrokenExecutor as error:
        pool.kill()
        raise WorkerLostError(
            "A process that looked at frames died.",
            "Is there memory enough? Fewer processes (`--workers 1`) need less.",
        ) from error
    except BaseException:
        pool.kill()
        raise
    pool.shutdown()


def _load() -> None:
    """In the process that others are forked from: what they need is imported with this module."""
    keep_pandas_lazy()


_checker = Checker(threads=1)


def _check(job: Sequence[Task]) -> list[Checked]:
    """In a process of a pool."""
    return [_checker.check(task) for task in job]
