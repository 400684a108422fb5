"""Runs as the page sees them: the queue, those that go on, those that have ended."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from carstage.errors import BadInputError
from carstage.runs.folder import new_run_id
from carstage.runs.launching import StopError, ask_to_stop
from carstage.web.configure.checking import ConfigChecker
from carstage.web.configure.store import ConfigStore
from carstage.web.errors import WebError, not_found
from carstage.web.messages import RunDetail, RunStart, RunSummary
from carstage.web.messages.base import Document
from carstage.web.preview.run_previews import Previews
from carstage.web.roots import Roots
from carstage.web.runs.follower import RunFollower
from carstage.web.runs.launches import Launch, Launches
from carstage.web.runs.records import RunRecord, RunRecords
from carstage.web.runs.summary import summary_of_launch, summary_of_record

_MOST_FOLLOWED = 4
_MOST_QUEUED = 50


class RunService:
    """Starts, queues, lists, follows and stops runs; safe to use from several threads.

    A run belongs to nobody: its state is in its folder and process, so one that an earlier server
    has started, or somebody in a terminal, is shown and stopped like any other.
    """

    def __init__(
        self,
        roots: Roots,
        launches: Launches,
        checker: ConfigChecker,
        store: ConfigStore,
        previews: Previews,
    ) -> None:
        self._roots = roots
        self._launches = launches
        self._checker = checker
        self._store = store
        self._previews = previews
        self._records = RunRecords(roots)
        self._lock = threading.RLock()
        self._followers: dict[str, RunFollower] = {}
        self._folders: dict[str, Path] = {}

    def summaries(self) -> list[RunSummary]:
        """All runs: queued ones in their order, then the others, newest first."""
        records = self._records.all()
        queued: list[RunSummary] = []
        begun: list[RunSummary] = []
        for launch in self._launches.all():
            if launch.run_id in records or launch.withdrawn:
                continue
            if launch.queued:
                queued.append(self._of_launch(launch, len(queued) + 1))
            else:
                begun.append(self._of_launch(launch, 0))
        begun += [self._of_record(record) for record in records.values()]
        return [*queued, *sorted(begun, key=lambda run: run.run_id, reverse=True)]

    def summary(self, run_id: str) -> RunSummary:
        """One run.

        Raises:
            WebError: there is none of that id.
        """
        for run in self.summaries():
            if run.run_id == run_id:
                return run
        raise not_found(f"run {run_id}")

    def start(self, request: RunStart) -> RunSummary:
        """Freeze a configuration, put it at the end of the queue, begin it if it is its turn.

        Raises:
            ConfigError: the configuration is wrong.
            WebError: the saved configuration is another than the user saw, the queue is full, or
                the dataset has episodes of other settings.
        """
        document = request.config
        if document is None:
            state = self._store.state()
            if request.rev is not None and request.rev != state.rev:
                raise WebError(409, "The configuration was changed meanwhile.", "Look at it again.")
            document = state.config
        config = self._checker.parse(document)
        self._checker.estimate(config)
        if sum(launch.queued for launch in self._launches.all()) >= _MOST_QUEUED:
            raise WebError(409, f"{_MOST_QUEUED} runs are queued already.", "Wait for their end.")
        from carstage.config import dump_config
        from carstage.runs.server_lock import server_key

        out = self._roots.new(request.dataset)
        document = dump_config(config)
        if not request.append:
            _refuse_to_mix(out, document)
        launch = Launch(
            run_id=new_run_id(),
            out=str(out),
            name=config.name,
            server=server_key(config),
            asked=time.time(),
            retries=request.retries,
            append=request.append,
        )
        self._launches.queue(launch, document)
        self.advance()
        return self.summary(launch.run_id)

    def stop(self, run_id: str) -> RunSummary:
        """Ask a run to stop; a second time ends it at once, a queued one leaves the queue.

        Raises:
            WebError: there is no such run, or it has ended.
        """
        with self._lock:
            run = self.summary(run_id)
            if run.alive == "ended":
                raise WebError(409, "The run has ended.", "Nothing is to be done.")
            if run.state != "queued":
                status = self._status(run_id)
                try:
                    ask_to_stop(status)
                except StopError as error:
                    raise WebError(409, error.message, error.hint) from error
            self._launches.stop_asked(run_id)
        self.advance()
        run = run.model_copy(update={"stop": run.stop + 1})
        if run.state == "queued":
            return run.model_copy(update={"state": "interrupted", "alive": "ended", "position": 0})
        return run

    def detail(self, run_id: str) -> RunDetail:
        """A run with its log and tick times.

        Raises:
            WebError: there is none of that id.
        """
        run = self.summary(run_id)
        record = self._records.all().get(run_id)
        if record is None:
            config: Document = self._launches.config(run_id)
            return RunDetail(run=run, config=config, log=[], ticks=[], channels=[])
        plan = record.plan()
        with self._lock:
            follower = self.follow(run_id)
            assert follower is not None
            follower.read()
            return RunDetail(
                run=run,
                config=dict(plan.config) if plan else {},
                log=follower.lines_after(0),
                ticks=follower.ticks_after(0),
                channels=self._previews.channels(run.sensors),
            )

    def follow(self, run_id: str) -> RunFollower | None:
        """The follower of a run; None for one without a folder. Use it under ``locked``."""
        folder = self.folder(run_id)
        if folder is None:
            return None
        follower = self._followers.pop(run_id, None) or RunFollower(folder)
        self._followers[run_id] = follower  # the newest last
        while len(self._followers) > _MOST_FOLLOWED:
            del self._followers[next(iter(self._followers))]
        return follower

    @property
    def locked(self) -> threading.RLock:
        """Held while a follower is used."""
        return self._lock

    def folder(self, run_id: str) -> Path | None:
        """The folder of a run, if it has one; looked for until it is found."""
        if run_id not in self._folders:
            record = self._records.all().get(run_id)
            if record is None:
                return None
            self._folders[run_id] = record.folder
        return self._folders[run_id]

    def advance(self) -> None:
        """Begin what is next in the queue, for each server that is free."""
        with self._lock:
            records = self._records.all()
            busy = {self._server_of(record) for record in records.values() if _lives(record)}
            for launch in self._launches.all():
                if launch.run_id not in records and self._launches.alive(launch):
                    busy.add(launch.server)
            for launch in self._launches.all():
                if launch.queued and launch.server not in busy:
                    busy.add(launch.server)
                    self._launches.begin(launch.run_id)

    def _server_of(self, record: RunRecord) -> str:
        launch = self._launches.get(record.run_id)
        if launch is not None:
            return launch.server
        plan = record.plan()
        if plan is None:
            return "here"
        try:
            from carstage.config import check_config
            from carstage.runs.server_lock import server_key

            return server_key(check_config({"server": plan.config.get("server", {})}))
        except BadInputError:
            return "here"

    def _status(self, run_id: str) -> Mapping[str, Any]:
        record = self._records.all().get(run_id)
        if record is not None:
            return self._records.fresh(record).status
        launch = self._launches.get(run_id)
        if launch is None:
            raise not_found(f"run {run_id}")
        return launch.process or {}

    def _of_launch(self, launch: Launch, position: int) -> RunSummary:
        alive = self._launches.alive(launch)
        tail = "" if launch.queued or alive else self._launches.output_tail(launch.run_id)
        return summary_of_launch(launch, position, alive=alive, tail=tail)

    def _of_record(self, record: RunRecord) -> RunSummary:
        launch = self._launches.get(record.run_id)
        rate = None
        with self._lock:
            if _lives(record):
                follower = self._followers.get(record.run_id) or self.follow(record.run_id)
                if follower is not None:
                    follower.read()
                    rate = follower.rate_ticks_s()
        return summary_of_record(
            record,
            stop=launch.stop if launch else 0,
            rate_ticks_s=rate,
            free_bytes=shutil.disk_usage(record.out).free,
        )


def _lives(record: RunRecord) -> bool:
    return record.alive in ("running", "stalled")


def _refuse_to_mix(out: Path, settings: Document) -> None:
    """Ask before a run records beside episodes of other settings.

    Versions and environment are compared by the run itself.
    """
    from carstage.runs.continuing import OtherSettingsError, refuse_to_mix
    from carstage.storage import open_store

    try:
        refuse_to_mix(out, out, open_store(out).committed(), None, settings)
    except OtherSettingsError as error:
        hint = "Record it all the same, or name another folder."
        raise WebError(409, error.message, hint, code="other_settings") from error
