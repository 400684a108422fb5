"""The episodes that a run has still to record."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Sequence

from carstage.runs.attempt_commit import Job
from carstage.spec import EpisodeSpec


class JobQueue:
    """Jobs in the order of the plan; those that come back are next.

    A job is made when it is taken: a plan may have a hundred thousand.

    Args:
        todo: the episodes to record.
    """

    def __init__(self, todo: Sequence[EpisodeSpec] = ()) -> None:
        self._todo = todo
        self._next = 0
        self._again: deque[Job] = deque()
        self._left_out: frozenset[str] = frozenset()

    def __len__(self) -> int:
        return len(self._again) + len(self._todo) - self._next - len(self._left_out)

    def __iter__(self) -> Iterator[Job]:
        yield from self._again
        for position in range(self._next, len(self._todo)):
            job = self._job(position)
            if job.episode_id not in self._left_out:
                yield job

    def popleft(self) -> Job:
        """The next job, which is no longer in the queue.

        Raises:
            IndexError: there is none.
        """
        if self._again:
            return self._again.popleft()
        while self._next < len(self._todo):
            job = self._job(self._next)
            self._next += 1
            if job.episode_id not in self._left_out:
                return job
            self._left_out -= {job.episode_id}
        raise IndexError("no job is left")

    def appendleft(self, job: Job) -> None:
        """Make a job the next one."""
        self._again.appendleft(job)

    def append(self, job: Job) -> None:
        """Add a job that comes after those that came back."""
        self._again.append(job)

    def leave_out(self, ids: Collection[str]) -> None:
        """Drop the jobs of some episodes, all of which are in the queue for the first time.

        Args:
            ids: of the episodes.
        """
        self._left_out |= frozenset(ids)

    def clear(self) -> int:
        """Drop all jobs; returns how many there were."""
        dropped = len(self)
        self._todo, self._next = (), 0
        self._again.clear()
        self._left_out = frozenset()
        return dropped

    def _job(self, position: int) -> Job:
        spec = self._todo[position]
        return Job(spec, spec.episode_id)
