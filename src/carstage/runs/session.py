"""The episodes of a run: recorded, tried again, handed to the commit queue, to every way out."""

from __future__ import annotations

import selectors
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from carstage.config import Config
from carstage.errors import (
    CarStageError,
    CollectorError,
    ConverterDiedError,
    DiskFullError,
    ServerEndedError,
)
from carstage.execution import Executor
from carstage.plan import EpisodePlan
from carstage.runs.attempt_commit import AttemptCommit, Job
from carstage.runs.commit_queue import CommitQueue
from carstage.runs.events import (
    AttemptReserved,
    EpisodeFailed,
    EpisodeRetried,
    EpisodeSkipped,
    ServerTested,
)
from carstage.runs.folder import CurrentEpisode
from carstage.runs.interruption import Interruption
from carstage.runs.jobs import JobQueue
from carstage.runs.known_verdicts import keep_verdict, known_verdict, verdict_file
from carstage.runs.record import RunRecord
from carstage.runs.run_session import RunSession
from carstage.runs.selftesting import describe_verdict, refuse, run_self_test
from carstage.runs.server_worker import POLL_S, ServerWorker
from carstage.runs.servers import ServerSetup
from carstage.runs.wakeup_pipe import WakeupPipe
from carstage.selftest import Verdict
from carstage.spec import EpisodeSpec
from carstage.storage import Store


class JobSource(Protocol):
    """Hands out jobs one by one, where the run itself is another process."""

    over: bool
    """Whether none comes any more."""
    idle: bool
    """Whether there is none at present; one may come."""

    def ask(self) -> None:
        """Ask for a job, unless one is asked for."""

    def received(self) -> list[tuple[Job, bool]]:
        """Jobs that have come, and of each whether it may be recorded already."""


class Session(RunSession):
    """A run, or a slot of one, that records in this process; the host of its worker.

    Args:
        config: what is recorded.
        setup: how the server is started.
        store: where episodes are committed.
        record: the run's events and status.
        interruption: the run's signals.
        wakeup: wakes the run when something is converted.
        retries: further attempts of an episode that fails.
        environment: what is recorded with, by version.
        executor: opens this session's worker.
        source: where jobs come from besides those of ``run``.
        self_test_folder: where the raw recording of a self-test lies; default: with the others.
    """

    def __init__(
        self,
        config: Config,
        setup: ServerSetup,
        store: Store,
        record: RunRecord,
        interruption: Interruption,
        wakeup: WakeupPipe,
        retries: int,
        environment: Mapping[str, str],
        executor: Executor,
        source: JobSource | None = None,
        self_test_folder: Path | None = None,
    ) -> None:
        super().__init__(store, record, interruption)
        self._executor = executor
        self._source = source
        self._self_test_folder = self_test_folder or record.folder.raw
        self._config = config
        self._setup = setup
        self._wakeup = wakeup
        self._retries = retries
        self._self_test: Mapping[str, Any] | None = None
        self._queue = CommitQueue(
            config,
            store,
            record,
            wakeup,
            environment,
            setup.raw_must_last,
            lambda attempt, error, final: self.attempt_failed(attempt, error, final=final),
        )
        self._jobs = JobQueue()
        self._recording: AttemptCommit | None = None

    @property
    def frames(self) -> int:
        """Frames of the episodes that were committed."""
        return self._queue.frames

    def _execute(self, todo: EpisodePlan) -> None:
        self._jobs = JobQueue(todo)
        if todo or self._source is not None:
            with self._interruption.deferred():  # no pool that nobody knows of
                self._queue.converters.pool()  # they load while the server starts
                taken = self._queue.take_pending(self._jobs) if todo else set()
            self._jobs.leave_out(taken)
            self._interruption.check()
        if self._jobs or self._source is not None:
            self._test_server()
        self._executor.execute(self)

    def _interrupted(self) -> None:
        if self._recording is not None:
            self._recording.cancel()  # for the sake of what is wholly recorded
        self._queue.use_the_time_left(self._interruption)

    # What the workers call.

    def begin(self, job: Job) -> AttemptCommit:
        """Reserve an attempt of the job."""
        holder = {"run_id": self._folder.run_id, **self._folder.process}
        attempt = self._store.reserve_attempt(job.episode_id, holder, job.first_attempt)
        self._record.event(AttemptReserved(episode_id=job.episode_id, attempt=attempt))
        try:
            attempt_commit = self._queue.attempt_commit(job, attempt, self._self_test)
        except BaseException:
            self._store.discard_attempt(job.episode_id, attempt)
            raise
        self._recording = attempt_commit
        self._attempted = True
        self._status.current = CurrentEpisode(
            episode_id=job.episode_id,
            index=self._number_of(job.spec),
            attempt=attempt,
            ticks_total=job.spec.steps,
            frames_total=job.spec.saved_frames,
        )
        self._record.enter("recording")
        return attempt_commit

    def on_event(self, event: Mapping[str, Any]) -> None:
        """Copy an event of the collector or the server into the run's."""
        self._record.copy_event(event)

    def poll(self) -> None:
        """Commit what is converted; keep the status fresh."""
        current, shown = self._status.current, self._recording
        if shown is None and self._queue.under_way:
            shown = self._queue.under_way[0]
        if current is not None and shown is not None and _is_of(current, shown):
            current.frames_converted = shown.frames_done
        if not self._setup.raw_must_last:
            for attempt_commit in filter(None, [self._recording, *self._queue.under_way]):
                attempt_commit.remove_converted()
        if self._config.conversion.mode == "streaming" or self._recording is None:
            self._queue.commit_converted()
        self._record.beat()

    def waiting(self, what: str) -> AbstractContextManager[None]:
        """Keep the heartbeat while the caller waits; explain by ``what`` when it takes long."""
        return self._record.waiting(what)

    def start_failed(self, job: Job, error: CarStageError) -> bool:
        """Count a server that was killed while it started as a try of the episode."""
        if job.tries >= self._retries:
            return False
        self._jobs.appendleft(replace(job, tries=job.tries + 1))
        what, _, _ = error.message.partition(" Its last words:")
        self._record.notice(f"{what} It is started again.")
        return True

    def recorded(self, attempt_commit: AttemptCommit, incomplete_ticks: int) -> bool:
        """Convert and commit a recording, at once or after all others; returns whether it may.

        Where every sensor has to deliver, an attempt with gaps is repeated as long as that is
        allowed. The last one is committed as it is: its ledger names every gap.
        """
        job = attempt_commit.job
        if incomplete_ticks and job.spec.timing.demands_all:
            what = f"Episode {job.episode_id}, attempt {attempt_commit.attempt}: "
            what += f"{incomplete_ticks} of {job.spec.steps} ticks lack data of a sensor."
            if job.tries < self._retries:
                attempt_commit.give_up()
                gaps = CollectorError(what, "See the collector's log and the server's.")
                self.attempt_failed(attempt_commit, gaps, final=False)
                return False
            self._record.notice(f"{what} It is kept: the ledger frames.parquet names them.")
        self._recording = None
        self._queue.add(attempt_commit)
        return True

    def attempt_failed(
        self, attempt_commit: AttemptCommit, error: CarStageError, *, final: bool
    ) -> None:
        """Try the episode again, unless that is pointless or it was tried often enough.

        Raises:
            DiskFullError: the error, as no other episode would fare better.
        """
        if attempt_commit is self._recording:  # else: converting failed, while another is recorded
            self._recording = None
        if isinstance(error, ConverterDiedError):
            self._queue.converters.retire()
        job = attempt_commit.job
        reason = str(error)
        full = isinstance(error, DiskFullError)
        if not final and not full and job.tries < self._retries:
            number = int(attempt_commit.attempt[1:])
            self._jobs.appendleft(Job(job.spec, job.episode_id, job.tries + 1, number + 1))
            self._record.event(
                EpisodeRetried(
                    episode_id=job.episode_id,
                    attempt=attempt_commit.attempt,
                    reason=reason,
                )
            )
            self._record.notice(f"{error.message} The episode is recorded again.")
            return
        self._failures[job.episode_id] = reason
        self._status.episodes.failed += 1
        self._record.event(
            EpisodeFailed(
                episode_id=job.episode_id,
                attempt=attempt_commit.attempt,
                reason=reason,
            )
        )
        if full:
            raise error

    # What the executor calls.

    def open_worker(self) -> ServerWorker:
        """See ``InlineWork.open_worker``."""
        python = str(self._setup.client.path)
        return ServerWorker(self._setup, self, self._folder, self._interruption, python=python)

    def _test_server(self) -> None:
        """Put the server to the self-test, where that is asked for, and keep the verdict.

        Raises:
            ServerError: it does not start, or fails the test and must not.
        """
        if not self._setup.tested:
            return
        kept = verdict_file(self._config, self._setup.client)
        verdict = known_verdict(kept)
        if verdict is None:
            with self.waiting("The server is started and tested before the run."):
                verdict = self._verdict(self._retries)
            keep_verdict(kept, verdict)
        self._self_test = verdict.to_json()
        self._record.event(ServerTested(**self._self_test))
        for sentence in describe_verdict(verdict):
            self._record.notice(sentence)
        if self._setup.must_pass and not verdict.ok:
            raise refuse(verdict)

    def _verdict(self, retries: int) -> Verdict:
        """What the self-test says; of our own server that ends meanwhile, it says nothing."""
        try:
            verdict = run_self_test(
                self._setup.warm_up(self._folder.logs / "server.log"),
                self._setup.client,
                self._self_test_folder,
                self._interruption,
                sensor_warmup_ticks=self._setup.sensor_warmup_ticks,
                has_ended=lambda: self._setup.has_ended,
            )
            if verdict.ok or not retries or not self._setup.has_ended:
                return verdict
        except ServerEndedError as error:
            if not (error.was_killed and retries):
                raise
        self._record.notice("The server ended before it was tested. It is started again.")
        return self._verdict(retries - 1)

    def take(self) -> Job | None:
        """The next episode; waits while conversions lag behind or may have to be repeated."""
        while True:
            self._wakeup.clear()
            with self._interruption.deferred():
                self.poll()
            self._interruption.check()
            self._fetch()
            if self._jobs and self.enough():
                self._drop_jobs()
            if self._jobs and not self._queue.full:
                job = self._jobs.popleft()
                if not self._store.has(job.episode_id):
                    return job
                self._skip(job)
                continue
            over = self._source is None or self._source.over
            none_now = over or (self._source is not None and self._source.idle)
            if over and not self._jobs and self._queue.empty:
                return None
            if none_now and not (self._jobs or self._queue.under_way or self._queue.empty):
                with self._interruption.deferred():
                    self._queue.begin_next()
            if not self._jobs and self._queue.under_way:
                self._show_conversion()
            self._wait()

    def _fetch(self) -> None:
        """Take what the source has handed out; ask for more where there is room."""
        if self._source is None:
            return
        for job, recorded in self._source.received():
            if not recorded:
                self._jobs.append(job)
                continue
            with self._interruption.deferred():
                if not self._queue.take_pending([job]):
                    self._jobs.append(job)
        if not self._jobs and not self._queue.full:
            self._source.ask()

    def _skip(self, job: Job) -> None:
        """Another run on the dataset has committed the episode since this one began."""
        self._status.episodes.skipped += 1
        reason = "another run has committed it meanwhile"
        self._record.event(EpisodeSkipped(episode_id=job.episode_id, reason=reason))

    def _number_of(self, spec: EpisodeSpec) -> int:
        """Number of an episode among all of the configuration, from 0."""
        return self._config.number_of(spec.index, spec.variant.name if spec.variant else None)

    def _show_conversion(self) -> None:
        attempt_commit = self._queue.under_way[0]
        if self._status.state != "converting":
            self._record.enter("converting")
        steps, frames = attempt_commit.job.spec.steps, attempt_commit.job.spec.saved_frames
        self._status.current = CurrentEpisode(
            episode_id=attempt_commit.job.episode_id,
            index=self._number_of(attempt_commit.job.spec),
            attempt=attempt_commit.attempt,
            ticks_done=steps,
            ticks_total=steps,
            frames_converted=attempt_commit.frames_done,
            frames_total=frames,
        )

    def _wait(self) -> None:
        """Wait until something is converted, a signal comes, or the status has to be renewed."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._interruption, selectors.EVENT_READ)
            selector.register(self._wakeup, selectors.EVENT_READ)
            selector.select(POLL_S)

    def _give_back(self) -> None:
        """Remove attempts that were not committed and end the converters, whatever fails."""
        if self._recording is not None:
            self._queue.drop(self._recording)
        self._queue.give_back()


def _is_of(current: CurrentEpisode, attempt_commit: AttemptCommit) -> bool:
    return (current.episode_id, current.attempt) == (
        attempt_commit.job.episode_id,
        attempt_commit.attempt,
    )
