"""What every run does from its first event to its last, wherever its episodes are recorded."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

from carstage.errors import (
    CarStageError,
    DiskFullError,
    ServerError,
    StorageError,
)
from carstage.plan import EpisodePlan
from carstage.runs.events import EpisodeSkipped, RunFinished, RunStarted
from carstage.runs.folder import State
from carstage.runs.interruption import LAST_ANSWER_S, Interruption
from carstage.runs.jobs import JobQueue
from carstage.runs.outcome import SOME_FAILED, RunResult
from carstage.runs.record import RunRecord
from carstage.storage import Store
from carstage.storage.disk import disk_error

ENOUGH = "All quotas are met: %d planned episodes are not recorded."


class RunSession(ABC):
    """The state of a run between its plan and its end.

    Args:
        store: where episodes are committed.
        record: the run's events and status.
        interruption: the run's signals.
    """

    def __init__(self, store: Store, record: RunRecord, interruption: Interruption) -> None:
        self._store = store
        self._record = record
        self._folder = record.folder
        self._status = record.status
        self._interruption = interruption
        self._failures: dict[str, str] = {}
        self._attempted = False
        self._jobs = JobQueue()
        self.enough: Callable[[], bool] = lambda: False
        """Whether no further episode need begin, though more are planned."""

    @property
    @abstractmethod
    def frames(self) -> int:
        """Frames of the episodes that were committed."""

    @abstractmethod
    def _execute(self, todo: EpisodePlan) -> None:
        """Record the episodes."""

    @abstractmethod
    def _interrupted(self) -> None:
        """The user ended the run: keep what is wholly recorded."""

    @abstractmethod
    def _give_back(self) -> None:
        """Remove attempts that were not committed and end what was started, whatever fails."""

    def run(self, episodes: EpisodePlan, todo: EpisodePlan) -> RunResult:
        """Record ``todo``; the other episodes are in the dataset already."""
        missing = set(todo.ids)
        self._status.episodes.total = len(episodes)
        self._status.episodes.skipped = len(episodes) - len(todo)
        state: State = "failed"
        try:
            self._record.event(RunStarted(run_id=self._folder.run_id))
            for episode_id in episodes.ids:
                if episode_id not in missing:
                    reason = "it is in the dataset already"
                    self._record.event(EpisodeSkipped(episode_id=episode_id, reason=reason))
            self._record.enter("starting")
            self._execute(todo)
            state = "done" if not self._failures else "failed"
        except KeyboardInterrupt:
            state = "interrupted"
            self._interrupt()
        except CarStageError as error:
            if self._interruption.requested and _is_of_the_store(error):
                state = "interrupted"
                self._record.notice(error.message)
                self._interrupt()
            else:
                self._explain(error)
                raise
        except OSError as error:
            failure = disk_error(error, f"in {self._folder.path}")
            self._status.message = str(failure)
            raise failure from error
        finally:
            with self._interruption.deferred(), self._store.within(self._last_s):
                self._give_back()
                self._status.current = None
                self._status.workers = []
                self._finish(state)
        return RunResult(
            run_id=self._folder.run_id,
            dataset=self._store.root,
            folder=self._folder.path,
            state=state,
            total=self._status.episodes.total,
            committed=self._status.episodes.committed,
            skipped=self._status.episodes.skipped,
            frames=self.frames,
            failures=self._failures,
        )

    def _interrupt(self) -> None:
        self._status.message = "Interrupted; the same command again continues."
        with self._interruption.deferred(), self._store.within(self._last_s):
            self._interrupted()

    def _explain(self, error: CarStageError) -> None:
        """Note why the run ends, and how far it has come."""
        self._status.message = str(error)
        counts = self._status.episodes
        if isinstance(error, DiskFullError) and (counts.committed or counts.skipped):
            error.exit_code = SOME_FAILED
        if isinstance(error, ServerError) and self._attempted:
            self._tell_how_to_go_on()

    def _last_s(self) -> float:
        """How long a store is still waited for at the end."""
        return self._interruption.left_before_s(LAST_ANSWER_S)

    def _drop_jobs(self) -> None:
        """Record nothing further: what is under way is still converted and committed."""
        left = self._jobs.clear()
        self._status.episodes.total -= left
        self._status.message = ENOUGH % left
        self._record.notice(self._status.message)

    def _tell_how_to_go_on(self) -> None:
        counts = self._status.episodes
        if not counts.total:
            return  # of several workers, the run itself says it
        self._record.notice(
            f"{counts.committed + counts.skipped} of {counts.total} episodes are in the dataset. "
            "The same command again continues with the rest."
        )

    def _finish(self, state: State) -> None:
        """Write down how it ended, where the disk lets us: a full one must not hide why."""
        counts = self._status.episodes
        try:
            try:
                self._record.enter(state)
            except StorageError:  # once more: a run without its last state looks like a dead one
                self._record.enter(state)
            self._record.event(
                RunFinished(state=state, committed=counts.committed, failed=counts.failed)
            )
        except StorageError as error:
            self._record.notice(f"{error.message} The next run on this dataset clears up.")


def _is_of_the_store(error: CarStageError) -> bool:
    """Whether an error only says that the store is away."""
    return isinstance(error, StorageError) and not isinstance(error, DiskFullError)
