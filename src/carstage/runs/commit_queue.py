"""The recordings of a run on their way into the dataset: converted, committed, or set aside."""

from __future__ import annotations

import math
import selectors
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from carstage.config import Config
from carstage.errors import (
    BadInputError,
    CarStageError,
    EpisodeExistsError,
    RequestGivenUpError,
)
from carstage.runs.attempt_commit import AttemptCommit, Job
from carstage.runs.converters import Converters, is_light
from carstage.runs.events import (
    AttemptReserved,
    EpisodeCommitted,
    EpisodeSkipped,
    FramesConverted,
)
from carstage.runs.interruption import Interruption
from carstage.runs.pending import pending_of, pending_recordings
from carstage.runs.record import RunRecord
from carstage.runs.wakeup_pipe import WakeupPipe
from carstage.storage import Store

_MOST_UNDER_WAY = 2
_COMMIT_S = 5.0
"""Of the time in which a run ends: for the last commit, and to give everything back."""
_LOOK_S = 0.2

Failed = Callable[[AttemptCommit, CarStageError, bool], None]
"""Told of an attempt that failed, with the error, and whether another one would fail, too."""


class CommitQueue:
    """Recordings that are being converted, and those whose conversion comes later.

    Args:
        config: what is recorded.
        store: where episodes are committed.
        record: the run's events and status.
        wakeup: woken whenever something is converted.
        environment: what is recorded with, by version.
        raw_must_last: whether raw logs are brought to the disk.
        failed: called when converting or committing fails; what was written is removed by then.
    """

    def __init__(
        self,
        config: Config,
        store: Store,
        record: RunRecord,
        wakeup: WakeupPipe,
        environment: Mapping[str, str],
        raw_must_last: bool,
        failed: Failed,
        irreplaceable: bool = False,
    ) -> None:
        self._store = store
        self._record = record
        self._folder = record.folder
        self._wakeup = wakeup
        self._environment = environment
        self._raw_must_last = raw_must_last
        self._failed = failed
        self._irreplaceable = irreplaceable
        self._codecs = config.conversion.codecs
        self._deferred = config.conversion.mode == "deferred"
        self._keep_raw = config.output.keep_raw
        self.converters = Converters(
            config.conversion.workers,
            pictures=any(one.row.is_camera for _, one in config.sensors_of_all_variants()),
            # What cannot be recorded again is not lost to an error of the system in this process.
            light=is_light(config) and not irreplaceable,
        )
        self._later: deque[AttemptCommit] = deque()
        self.under_way: list[AttemptCommit] = []
        """What is being converted, the oldest first."""
        self.frames = 0
        """Frames of the episodes that were committed."""

    @property
    def full(self) -> bool:
        """Whether recording should wait: conversion lags behind."""
        return len(self.under_way) >= _MOST_UNDER_WAY

    @property
    def empty(self) -> bool:
        """Whether nothing waits to be committed."""
        return not self.under_way and not self._later

    def __iter__(self) -> Iterator[AttemptCommit]:
        """All recordings."""
        return iter([*self.under_way, *self._later])

    def attempt_commit(
        self, job: Job, attempt: str, self_test: Mapping[str, Any] | None = None
    ) -> AttemptCommit:
        """An attempt of the run; it is not in the queue before :meth:`add`."""
        raw_folder = self._folder.raw_attempt(job.episode_id, attempt)
        raw_folder.parent.mkdir(parents=True, exist_ok=True)
        return AttemptCommit(
            job,
            attempt,
            raw_folder,
            self._store,
            self.converters.pool(),
            self._codecs,
            self_test,
            deferred=self._deferred,
            progress=self._wakeup.notify,
            left_s=self._record.left_s,
        )

    def add(self, attempt_commit: AttemptCommit) -> None:
        """Commit a recording once it is converted; its conversion may begin after all others."""
        if self._deferred:
            attempt_commit.set_aside(self._environment, durable=True)
        self._line_up(attempt_commit)

    def _line_up(self, attempt_commit: AttemptCommit) -> None:
        (self._later if self._deferred else self.under_way).append(attempt_commit)

    def begin_next(self) -> None:
        """Begin to convert the first of the recordings that were to be converted later."""
        attempt_commit = self._later.popleft()
        self.under_way.append(attempt_commit)
        try:
            attempt_commit.convert_all(self.converters.pool())
        except CarStageError as error:
            self._give_up(attempt_commit, error)

    def begin_all(self) -> None:
        """Begin to convert all that were to be converted later."""
        while self._later:
            self.begin_next()

    def commit_converted(self) -> None:
        """Commit what is converted."""
        for attempt_commit in list(self.under_way):
            self._commit_if_ready(attempt_commit)

    def take_pending(self, jobs: Iterable[Job]) -> set[str]:
        """Go on with what earlier runs of these settings have recorded and not converted.

        Returns:
            Ids of the episodes that need not be recorded.
        """
        taken: set[str] = set()
        # Those of this run are of a worker that is gone.
        recordings = [*pending_recordings(self._folder.work), *pending_of(self._folder.path)]
        if not recordings:
            return taken
        ids = {recording.episode_id for recording in recordings}
        wanted = {job.episode_id: job for job in jobs if job.episode_id in ids}
        for recording in recordings:
            pending, episode_id = recording.pending, recording.episode_id
            raw_folder = self._folder.raw_attempt(episode_id, recording.attempt)
            changed = pending.environment != self._environment
            if (
                episode_id not in wanted
                or (changed and not self._irreplaceable)
                or pending.codecs != self._codecs
                or not recording.take(raw_folder)
            ):
                continue
            if changed:  # what was converted may be other bytes now
                pending = replace(pending, converted=())
            attempt_commit = self.attempt_commit(wanted[episode_id], recording.attempt)
            if not (pending.durable or pending.of_this_boot):
                # The shape of the raw log could be checked, but not what its pictures hold.
                attempt_commit.give_up()
                continue
            del wanted[episode_id]
            taken.add(episode_id)
            self._record.event(AttemptReserved(episode_id, recording.attempt))
            self._record.notice(f"Episode {episode_id} is recorded already; it is converted now.")
            self._line_up(attempt_commit)
            try:
                if self._deferred:  # until it is converted it stays what it was
                    attempt_commit.leave(pending)
                attempt_commit.go_on(pending, self.converters.pool())
            except RequestGivenUpError:
                self._forget(attempt_commit)
                attempt_commit.leave(pending)
            except CarStageError as error:
                self._give_up(attempt_commit, error)
        return taken

    def use_the_time_left(self, interruption: Interruption) -> None:
        """Commit what is recorded as far as the time allows; set the rest aside.

        Raises:
            StorageError: what is set aside cannot be written down.
        """
        while not self.empty and interruption.left_s > _COMMIT_S:
            self._wakeup.clear()
            for attempt_commit in list(self.under_way):
                if interruption.left_s > _COMMIT_S:
                    self._commit_if_ready(attempt_commit)
            if self._later and not self.under_way:
                self.begin_next()
            self._record.beat()
            if self.under_way:
                with selectors.DefaultSelector() as selector:
                    selector.register(self._wakeup, selectors.EVENT_READ)
                    selector.select(_LOOK_S)
        self.converters.kill()
        count = len(self.under_way) + len(self._later)
        while self.under_way:
            attempt_commit = self.under_way.pop()
            attempt_commit.set_aside(self._environment, durable=self._raw_must_last)
        self._later.clear()  # those were set aside as soon as they were recorded
        self._tell_of_waiting(count)

    def _tell_of_waiting(self, count: int) -> None:
        if count:
            self._record.notice(
                f"{count} recorded episode{'s' if count > 1 else ''} not yet converted: "
                "the next run of the same command does it."
            )

    def give_back(self) -> None:
        """Remove what was not committed and end the converters, whatever fails.

        What is converted after all recording was set aside as soon as it was recorded, and stays.
        """
        if self._deferred:
            for attempt_commit in self:
                attempt_commit.cancel()
            self._tell_of_waiting(len(self.under_way) + len(self._later))
        elif not self._irreplaceable:
            for attempt_commit in self:
                self.drop(attempt_commit)
        self.converters.end(at_once=self._record.left_s() < math.inf)

    def drop(self, attempt_commit: AttemptCommit) -> None:
        """Remove an attempt; says so where that fails."""
        try:
            attempt_commit.give_up()
        except (CarStageError, OSError) as error:
            folder = f"episodes/{attempt_commit.job.episode_id}/{attempt_commit.attempt}"
            self._record.notice(f"{folder} could not be removed and is no part of it: {error}")

    def _commit_if_ready(self, attempt_commit: AttemptCommit) -> None:
        """Commit an attempt whose frames are converted."""
        episode_id = attempt_commit.job.episode_id
        episodes = self._record.status.episodes
        try:
            if not attempt_commit.is_ready():
                return
            frames = attempt_commit.commit()
        except RequestGivenUpError:
            return  # it waits for the next run, which will see whether it was committed
        except EpisodeExistsError as error:
            self.under_way.remove(attempt_commit)
            episodes.skipped += 1
            attempt_commit.remove_raw()
            reason = error.message
            self._record.event(EpisodeSkipped(episode_id, reason, attempt_commit.attempt))
        except CarStageError as error:
            self._give_up(attempt_commit, error)
        else:
            self.under_way.remove(attempt_commit)
            episodes.committed += 1
            self.frames += frames
            if not self._keep_raw:
                attempt_commit.remove_raw()
            self._record.event(FramesConverted(episode_id=episode_id, frames=frames))
            self._record.event(EpisodeCommitted(episode_id, attempt_commit.attempt))

    def _give_up(self, attempt_commit: AttemptCommit, error: CarStageError) -> None:
        """Converting or committing an attempt failed: what can be recorded again goes."""
        self._forget(attempt_commit)
        if self._irreplaceable:
            attempt_commit.cancel()
        else:
            attempt_commit.give_up()
        self._failed(attempt_commit, error, isinstance(error, BadInputError))

    def _forget(self, attempt_commit: AttemptCommit) -> None:
        if attempt_commit in self.under_way:
            self.under_way.remove(attempt_commit)
        else:
            self._later.remove(attempt_commit)
