"""A run whose episodes are recorded by several workers, each a process of its own.

It hands the jobs out, hears what the slots say, and writes it into the one run folder. What a dead
slot has left (processes, raw recordings, attempts) is removed at once, and its jobs wait again.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

from carstage.errors import StorageError
from carstage.execution import Executor, SlotEnd, SlotProgram
from carstage.plan import EpisodePlan
from carstage.runs.attempt_commit import Job
from carstage.runs.events import (
    EpisodeCommitted,
    EpisodeFailed,
    EpisodeRetried,
    RunEvent,
    WorkerLost,
    WorkerStarted,
)
from carstage.runs.folder import CurrentEpisode, State, WorkerStatus
from carstage.runs.identity import life_of
from carstage.runs.interruption import Interruption
from carstage.runs.jobs import JobQueue
from carstage.runs.orphans import end_orphans_of_worker
from carstage.runs.pending import PENDING_FILE, pending_recordings
from carstage.runs.record import RunRecord
from carstage.runs.run_session import RunSession
from carstage.storage import Store

_FINISHED = ("episode_committed", "episode_failed", "episode_skipped")


class Fleet(RunSession):
    """A run that lets slots record; the work of a ``SlotsExecutor``.

    Args:
        store: where episodes are committed.
        record: the run's events and status.
        interruption: the run's signals.
        retries: further attempts of an episode that fails, or whose worker dies.
        executor: where the slots are.
        program: what a slot runs, by its number.
    """

    def __init__(
        self,
        store: Store,
        record: RunRecord,
        interruption: Interruption,
        retries: int,
        executor: Executor,
        program: Callable[[int], SlotProgram],
    ) -> None:
        super().__init__(store, record, interruption)
        self._retries = retries
        self._executor = executor
        self._program = program
        self._tries: dict[str, Job] = {}
        self._recorded: set[str] = set()
        self._begun: dict[int, dict[str, str]] = {}
        self._silent: list[tuple[str, str]] = []
        self._frames = 0
        self._total = 0
        self._began_s: float | None = None

    @property
    def frames(self) -> int:
        """Frames of the episodes that were committed."""
        return self._frames

    def _execute(self, todo: EpisodePlan) -> None:
        self._jobs = JobQueue(todo)
        self._total = len(todo)
        waiting = pending_recordings(self._folder.work)
        self._recorded = {recording.episode_id for recording in waiting}
        with self._interruption.deferred():
            self._executor.execute(self)

    def _interrupted(self) -> None:
        """Nothing: all slots have ended by now, kept what they could, and said so."""

    def _give_back(self) -> None:
        for worker in list(self._begun):
            self._clear_up(worker)
        if self._silent:
            # A worker that only seems dead may still commit: what it has goes where it cannot.
            markers = self._store.committed()
            for episode_id, attempt in self._silent:
                if episode_id in markers and markers[episode_id].attempt != attempt:
                    self._remove(episode_id, attempt)

    # What the executor asks.

    @property
    def left(self) -> int:
        """How many jobs wait."""
        return len(self._jobs)

    @property
    def left_s(self) -> float:
        """Seconds until all has to have ended."""
        return self._interruption.left_s

    def fileno(self) -> int:
        """Readable once a signal has come."""
        return self._interruption.fileno()

    def poll(self) -> None:
        """Renew the heartbeat; see ``SlotWork.poll``."""
        status = self._status
        status.workers.sort(key=lambda one: one.worker)
        status.current = next((one.current for one in status.workers if one.current), None)
        status.eta_s = self._eta_s()
        states = {one.state for one in status.workers}
        state: State = (
            "recording"
            if "recording" in states
            else "converting"
            if "converting" in states
            else status.state
        )
        if state != status.state:
            self._record.enter(state)
        self._record.beat()
        self._interruption.check()

    def take(self) -> Job | None:
        """The next job; None: none waits now."""
        if self._jobs and self.enough():
            self._drop_jobs()
        return self._jobs.popleft() if self._jobs else None

    def key(self, job: Job) -> str:
        """The episode's id."""
        return job.episode_id

    def describe(self, job: Job) -> Mapping[str, Any]:
        """The job as the slot reads it."""
        self._tries[job.episode_id] = job
        return {
            "episode_id": job.episode_id,
            "spec": job.spec.to_json(),
            "tries": job.tries,
            "first_attempt": job.first_attempt,
            "recorded": job.episode_id in self._recorded,
        }

    def program(self, slot: int) -> SlotProgram:
        """What a slot runs."""
        return self._program(slot)

    def on_message(self, slot: int, message: Mapping[str, Any]) -> None:
        """Take an event, a status or a sentence of a slot into the run's folder."""
        match message.get("say"):
            case "event":
                self._take_event(slot, message["line"])
            case "status":
                self._worker(slot, message["process"]).state = message["state"]
                current = message["current"]
                if current is None or current["episode_id"] in self._tries:
                    shown = None if current is None else CurrentEpisode(**current)
                    self._worker(slot, message["process"]).current = shown
            case "notice":
                self._record.notice(f"Worker {slot}: {message['sentence']}")

    def lost(self, slot: int, jobs: list[Job], end: SlotEnd, *, blame: bool) -> None:
        """Clear up after a slot that is gone, and let its jobs wait again."""
        reason = end.reason
        certain = end.certain or any(
            life_of(one.process) == "dead" for one in self._status.workers if one.worker == slot
        )
        self._status.workers = [one for one in self._status.workers if one.worker != slot]
        begun = dict(self._begun.get(slot, {}))
        if not certain:
            self._silent += self._begun.pop(slot, {}).items()
        elif blame or not self._interruption.requested:
            if blame:  # what it recorded to try its server
                shutil.rmtree(self._folder.raw / f"worker-{slot}", ignore_errors=True)
            self._clear_up(slot)
            self._recorded |= {
                episode_id
                for episode_id, attempt in begun.items()
                if (self._folder.raw_attempt(episode_id, attempt) / PENDING_FILE).exists()
            }
        if blame:
            self._write(slot, WorkerLost(worker=slot, reason=reason))
            self._record.notice(reason)
        for job in reversed(jobs):
            self._put_back(slot, job, begun.get(job.episode_id), reason, blame=blame)

    def _put_back(
        self, slot: int, job: Job, attempt: str | None, reason: str, *, blame: bool
    ) -> None:
        now = self._tries.pop(job.episode_id, job)
        first = now.first_attempt if attempt is None else int(attempt[1:]) + 1
        if attempt is not None and self._is_committed(job.episode_id):
            self._frames += job.spec.saved_frames
            self._status.episodes.committed += 1  # it died before it could say so
            self._write(slot, EpisodeCommitted(job.episode_id, attempt))
        elif not blame:
            self._jobs.appendleft(replace(now, first_attempt=first))
        elif now.tries < self._retries:
            self._jobs.appendleft(replace(now, tries=now.tries + 1, first_attempt=first))
            self._write(slot, EpisodeRetried(job.episode_id, attempt or f"a{first}", reason))
        else:
            self._failures[job.episode_id] = reason
            self._status.episodes.failed += 1
            self._write(slot, EpisodeFailed(job.episode_id, attempt or f"a{first}", reason))

    def _is_committed(self, episode_id: str) -> bool:
        try:
            return self._store.has(episode_id)
        except StorageError:
            if not self._interruption.requested:
                raise
            return False  # the next run will see it

    def _take_event(self, slot: int, line: Mapping[str, Any]) -> None:
        name, episode_id = line["event"], str(line.get("episode_id", ""))
        counts = self._status.episodes
        begun = self._begun.setdefault(slot, {})
        if name == "attempt_reserved":
            self._attempted = True
            self._began_s = self._began_s or time.monotonic()
            begun[episode_id] = str(line["attempt"])
        elif name == "frames_converted":
            self._frames += int(line["frames"])
        elif name == "episode_committed":
            counts.committed += 1
        elif name == "episode_skipped":
            counts.skipped += 1
        elif name == "episode_failed":
            counts.failed += 1
            self._failures[episode_id] = str(line["reason"])
        elif name == "episode_retried":
            job = self._tries[episode_id]
            number = int(str(line["attempt"])[1:])
            self._tries[episode_id] = replace(job, tries=job.tries + 1, first_attempt=number + 1)
        if name in (*_FINISHED, "episode_retried"):
            begun.pop(episode_id, None)
        if name in _FINISHED:
            self._tries.pop(episode_id, None)
            for one in self._status.workers:
                if one.current is not None and one.current.episode_id == episode_id:
                    one.current = None
        self._record.copy_event({**line, "worker": slot})

    def _worker(self, slot: int, process: Mapping[str, Any]) -> WorkerStatus:
        for one in self._status.workers:
            if one.worker == slot:
                return one
        one = WorkerStatus(slot, "starting", process)
        self._status.workers.append(one)
        event = WorkerStarted(slot, str(process.get("host", "")), int(process.get("pid", 0)))
        self._write(slot, event)
        return one

    def _write(self, slot: int, event: RunEvent) -> None:
        """Write an event of the run itself about a slot."""
        self._record.copy_event({**event.to_line(), "worker": slot})

    def _clear_up(self, slot: int) -> None:
        """End what a slot has left running, and remove what it has not recorded to its end."""
        end_orphans_of_worker(self._folder.run_id, slot, self._folder.process)
        own = self._folder.raw / f"worker-{slot}"
        with suppress(OSError):  # none, or a failed self-test's recording, which is kept
            own.rmdir()
        for episode_id, attempt in self._begun.pop(slot, {}).items():
            raw = self._folder.raw_attempt(episode_id, attempt)
            if not (raw / PENDING_FILE).exists():
                self._remove(episode_id, attempt)

    def _remove(self, episode_id: str, attempt: str) -> None:
        """Remove an attempt and its raw recording; a committed one stays."""
        with suppress(StorageError):
            self._store.discard_attempt(episode_id, attempt)
        raw = self._folder.raw_attempt(episode_id, attempt)
        shutil.rmtree(raw, ignore_errors=True)
        with suppress(OSError):  # other attempts may stand beside it
            raw.parent.rmdir()

    def _eta_s(self) -> float | None:
        """What the rest takes at the pace since the first episode began."""
        if self._began_s is None:
            return None
        left = float(len(self._jobs) + len(self._tries))
        for one in self._status.workers:
            if one.current is not None and one.current.ticks_total:
                left -= one.current.ticks_done / one.current.ticks_total
        done = self._total - left
        if done <= 0:
            return None
        return round((time.monotonic() - self._began_s) / done * left, 1)
