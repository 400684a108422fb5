"""Runs as the page sees them: the queue, those that go on, those that have ended."""

from __future__ import annotations

import shutil
import stat
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from carstage.errors import BadInputError
from carstage.runs.folder import new_run_id
from carstage.runs.keeping import remove_run, rename_run, settings_of, share_of
from carstage.runs.launching import RunOptions, StopError, ask_to_stop
from carstage.storage.address import dataset_root
from carstage.storage.keeping import check_label
from carstage.storage.remote_path import DatasetPath, RemotePath
from carstage.web.archive import files_below, zipped
from carstage.web.configure.checking import ConfigChecker
from carstage.web.configure.store import ConfigStore
from carstage.web.errors import WebError, not_found
from carstage.web.messages import LogLine, RunAgain, RunDetail, RunStart, RunSummary
from carstage.web.messages.base import Document
from carstage.web.preview.run_previews import Previews
from carstage.web.roots import Roots
from carstage.web.runs.follower import RunFollower
from carstage.web.runs.launches import Launch, Launches
from carstage.web.runs.records import RunRecord, RunRecords
from carstage.web.runs.summary import Seen, summary_of_launch, summary_of_record

_MOST_FOLLOWED = 4
_MOST_QUEUED = 50


class RunService:
    """Starts, queues, lists, follows and stops runs; safe to use from several threads.

    A run belongs to nobody: its state is in its folder and process, so one that an earlier server
    has started, or somebody in a terminal, is shown and stopped like any other.

    Args:
        roots: where datasets are.
        launches: runs that were asked for here.
        checker: what is a valid configuration.
        store: the saved configuration.
        previews: live pictures of runs.
        make_room: has a server given back, by its key, that a run is about to use.
    """

    def __init__(
        self,
        roots: Roots,
        launches: Launches,
        checker: ConfigChecker,
        store: ConfigStore,
        previews: Previews,
        make_room: Callable[[str], None] = lambda server: None,
    ) -> None:
        self._roots = roots
        self._launches = launches
        self._checker = checker
        self._store = store
        self._previews = previews
        self._make_room = make_room
        self._records = RunRecords(roots, launches)
        for launch in launches.all():
            self._show(launch.place)
        self._lock = threading.RLock()
        self._followers: dict[str, RunFollower] = {}
        self._folders: dict[str, Path] = {}
        self._progress: dict[str, float] = {}
        self._stops: dict[str, int] = {}  # of runs that were not asked for here

    def summaries(self) -> list[RunSummary]:
        """All runs: queued ones in their order, then the others, newest first.

        One whose folder is gone with its dataset, or lies in one that was moved away, is left out:
        nothing tells how it has ended.
        """
        records = self._records.all()
        queued: list[RunSummary] = []
        begun: list[RunSummary] = []
        for launch in self._launches.all():
            if launch.run_id in records:
                self._launches.folder_seen(launch.run_id)
            elif launch.queued:
                queued.append(self._of_launch(launch, len(queued) + 1))
            elif not launch.withdrawn and (not launch.has_folder or self._launches.alive(launch)):
                begun.append(self._of_launch(launch, 0))
        begun += [self._of_record(record) for record in records.values()]
        return [*queued, *sorted(begun, key=lambda run: run.run_id, reverse=True)]

    def summary(self, run_id: str) -> RunSummary:
        """One run.

        Raises:
            WebError: there is none of that id.
        """
        found = self._find(run_id)
        if found is None:
            self._roots.forget()  # its dataset may have been made within the second
            found = self._find(run_id)
        if found is None:
            raise not_found(f"run {run_id}")
        return found

    def _find(self, run_id: str) -> RunSummary | None:
        return next((run for run in self.summaries() if run.run_id == run_id), None)

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
        return self._begin(document, request)

    def again(self, run_id: str, request: RunAgain) -> RunSummary:
        """Go on with a run that has ended, or record the same in another dataset.

        Raises:
            WebError: there is no such run, it goes on, or it has recorded everything.
            BadInputError: it keeps no configuration, or one that cannot be used any more, or it
                recorded what another program drove.
        """
        run = self.summary(run_id)
        if request.dataset is None and not run.resumable:
            done = run.alive == "ended"
            raise WebError(
                409,
                "The run has recorded everything." if done else "The run goes on.",
                "Record it once more into another dataset." if done else "Stop it first.",
            )
        folder = self.folder(run_id)
        share = None if folder is None else share_of(folder)
        if share is not None and request.dataset is None:
            raise WebError(
                409,
                f"The run records the share {share} of its episodes; the page would record all.",
                f"Go on with it by `carstage runs resume {run.location} {run_id}`.",
            )
        launch = self._launches.get(run_id)
        given = launch.options if launch is not None else RunOptions()
        return self._begin(
            self.settings(run_id),
            RunStart.model_construct(
                dataset=request.dataset or run.location,
                retries=given.retries,
                append=given.append and request.dataset is None,
                workers=given.workers,
                catalog=given.catalog,
                work=given.work,
            ),
            continues=run_id if request.dataset is None else None,
        )

    def settings(self, run_id: str) -> Document:
        """The configuration of a run.

        Raises:
            WebError: there is no such run.
            BadInputError: it keeps none.
        """
        if self._launches.get(run_id) is not None:
            return self._launches.config(run_id)
        folder = self.folder(run_id)
        if folder is None:
            raise not_found(f"run {run_id}")
        return dict(settings_of(folder))

    def configurations(self, dataset: str) -> list[tuple[str, Document]]:
        """What planned runs have recorded into a dataset by, each with its run, the newest first.

        Args:
            dataset: id of the dataset.
        """
        into = (one for one in self._records.all().values() if one.dataset == dataset)
        plans = ((one.run_id, one.plan()) for one in into)
        found = [(run_id, dict(plan.config)) for run_id, plan in plans if plan is not None]
        return sorted(found, key=lambda entry: entry[0], reverse=True)

    def options(self, run_id: str) -> RunOptions:
        """How the command of a run was given its options; of runs of others, the usual ones."""
        launch = self._launches.get(run_id)
        if launch is not None:
            return launch.options
        return RunOptions()

    def rename(self, run_id: str, name: str) -> RunSummary:
        """Show a run by another name.

        Raises:
            WebError: there is no such run.
            BadInputError: the name cannot be used.
        """
        name = check_label(name)
        self.summary(run_id)
        folder = self.folder(run_id)
        if folder is not None:
            rename_run(folder, name)
        self._launches.rename(run_id, name)
        return self.summary(run_id)

    def remove(self, run_id: str) -> None:
        """Remove a run that goes on no more; its episodes stay in their dataset.

        Raises:
            WebError: there is no such run, or it goes on.
        """
        with self._lock:
            run = self.summary(run_id)
            if run.alive in ("running", "stalled"):
                raise WebError(409, "The run goes on.", "Stop it first.")
            folder = self.folder(run_id)
            if folder is not None:
                remove_run(folder)
            self._launches.remove(run_id)
            self._followers.pop(run_id, None)
            self._folders.pop(run_id, None)
            self._progress.pop(run_id, None)
            self._stops.pop(run_id, None)

    def forget(self, place: DatasetPath) -> None:
        """Forget the runs into a dataset that is gone."""
        dataset = self._roots.id_of(place)
        for run in self.summaries():
            if run.dataset == dataset:
                self.remove(run.run_id)
        for launch in self._launches.all():  # also those that are left out above
            if self._roots.id_of(launch.place) == dataset:
                self._launches.remove(launch.run_id)

    def archive(self, run_id: str) -> Iterator[bytes]:
        """A run's own folder as a ZIP archive, without its recordings.

        Raises:
            WebError: there is no such run, or it has no folder.
        """
        folder = self.folder(run_id)
        if folder is None:
            raise not_found(f"folder of run {run_id}")
        kept = (one for one in files_below(folder) if not one[0].startswith(("raw/", "preview/")))
        return zipped((f"run-{run_id}/{name}", path) for name, path in kept)

    def records_into(self, place: DatasetPath) -> bool:
        """Whether a run writes, or is queued to write, into a dataset."""
        dataset = self._roots.id_of(place)
        return any(
            run.dataset == dataset and run.alive in ("queued", "running", "stalled")
            for run in self.summaries()
        )

    def _begin(
        self, document: Document, request: RunStart, continues: str | None = None
    ) -> RunSummary:
        config = self._checker.parse(document)
        self._checker.estimate(config)
        if sum(launch.queued for launch in self._launches.all()) >= _MOST_QUEUED:
            raise WebError(409, f"{_MOST_QUEUED} runs are queued already.", "Wait for their end.")
        from carstage.config import dump_config
        from carstage.runs.preflight import work_folder
        from carstage.runs.server_lock import server_key

        out = self._place(request.dataset)
        work = self._roots.work(request.work) if request.work else None
        catalog = self._catalog(request.catalog)
        document = dump_config(config)
        if not request.append:
            self._refuse_to_mix(out, work_folder(out, work), document)
        if isinstance(out, RemotePath):
            from carstage.storage import open_store

            open_store(out).check()
        launch = Launch(
            run_id=new_run_id(),
            out=str(out),
            name=config.name,
            server=server_key(config),
            asked=time.time(),
            retries=request.retries,
            append=request.append,
            workers=request.workers,
            catalog=catalog,
            work=None if work is None else str(work),
            continues=continues,
        )
        self._launches.queue(launch, document)
        self._show(out)
        self.advance()
        return self.summary(launch.run_id)

    def _place(self, text: str) -> DatasetPath:
        """Where a run records: what a user wrote, or where an earlier run has recorded."""
        known = (run.location for run in self.summaries())
        if text in known:
            return dataset_root(text)
        return self._roots.destination(text)

    def _catalog(self, given: str | None) -> str | None:
        """The address of a catalog that a request may name.

        Raises:
            BadInputError: it is none, holds a password, or is a file outside.
        """
        if not given:
            return None
        from carstage.catalog.address import parse_address

        address = parse_address(given, secret=False)
        if address.file is not None:
            return str(self._roots.work(str(address.file)))
        return given

    def _show(self, place: DatasetPath) -> None:
        """Have a dataset shown that lies in no root, as a run records into it."""
        if isinstance(place, RemotePath):
            self._roots.add(place)

    def _refuse_to_mix(self, out: DatasetPath, work: Path, settings: Document) -> None:
        """Ask before a run records beside episodes of other settings.

        Versions and environment are compared by the run itself.
        """
        from carstage.runs.continuing import OtherSettingsError, refuse_to_mix

        try:
            present = self._roots.dataset(self._roots.id_of(out)).markers()
        except WebError:
            return  # there is no dataset yet
        try:
            refuse_to_mix(out, work, present, None, settings)
        except OtherSettingsError as error:
            hint = "Record it all the same, or name another folder."
            raise WebError(409, error.message, hint, code="other_settings") from error

    def stop(self, run_id: str, seen: int | None = None) -> RunSummary:
        """Ask a run to stop; a second time ends it at once, a queued one leaves the queue.

        Args:
            run_id: which run.
            seen: how often it had been asked as far as who asks knows. When it has been asked since
                then, nothing is done: nobody meant to end it at once. None: whoever asks means it.

        Raises:
            WebError: there is no such run, or it has ended.
        """
        with self._lock:
            run = self.summary(run_id)
            if run.alive == "ended":
                raise WebError(409, "The run has ended.", "Nothing is to be done.")
            if seen is not None and seen < run.stop:
                return run
            if run.state != "queued":
                status = self._status(run_id)
                try:
                    ask_to_stop(status)
                except StopError as error:
                    raise WebError(409, error.message, error.hint) from error
            if self._launches.get(run_id) is None:
                self._stops[run_id] = run.stop + 1
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
            log = [] if run.alive != "ended" else self.output(run_id)
            return RunDetail(run=run, config=config, log=log, ticks=[], channels=[])
        plan = record.plan()
        with self._lock:
            follower = self.follow(run_id)
            assert follower is not None
            follower.read()
            return RunDetail(
                run=run,
                config=dict(plan.config) if plan else {},
                log=follower.lines_after(0),
                ticks=follower.ticks.after(0),
                loads=follower.loads.after(0),
                channels=self._previews.channels(run.sensors),
                committed=list(follower.committed),
                bytes=_size(record.folder),
            )

    def output(self, run_id: str) -> list[LogLine]:
        """What the command of a run that never made a folder has printed, as a log."""
        launch = self._launches.get(run_id)
        time_s = 0.0 if launch is None else self._launches.ended_s(launch) or launch.asked
        return [
            LogLine(
                time=time_s,
                level="error" if line.startswith("Error: ") else "info",
                event="output",
                text=line.removeprefix("Error: ")[:2000],
            )
            for line in self._launches.output_tail(run_id).splitlines()
            if line.strip()
        ]

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
            busy = self._busy()
            for launch in self._launches.all():
                if launch.queued and launch.server not in busy:
                    busy.add(launch.server)
                    self._make_room(launch.server)
                    self._launches.begin(launch.run_id)

    def uses(self, server: str) -> bool:
        """Whether a run uses a server, by its key, or waits for it."""
        waiting = any(launch.queued and launch.server == server for launch in self._launches.all())
        return waiting or server in self._busy()

    def _busy(self) -> set[str]:
        """The servers that runs use."""
        records = self._records.all()
        busy = {self._server_of(record) for record in records.values() if _lives(record)}
        for launch in self._launches.all():
            if launch.run_id not in records and self._launches.alive(launch):
                busy.add(launch.server)
        return busy

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
        over = not launch.queued and not alive
        return summary_of_launch(
            launch,
            self._roots.id_of(launch.place),
            position,
            alive=alive,
            tail=self._launches.output_tail(launch.run_id) if over else "",
            ended_s=self._launches.ended_s(launch) if over else None,
        )

    def _of_record(self, record: RunRecord) -> RunSummary:
        rate, retried = None, {}
        with self._lock:
            if _lives(record):
                follower = self._followers.get(record.run_id) or self.follow(record.run_id)
                if follower is not None:
                    follower.read()
                    rate, retried = follower.rate_ticks_s(), dict(follower.retried)
            launch = self._launches.get(record.run_id)
            seen = Seen(
                launch=launch,
                stop=launch.stop if launch else self._stops.get(record.run_id, 0),
                rate_ticks_s=rate,
                free_bytes=shutil.disk_usage(record.folder).free,
                retried=retried,
                progress=self._progress.get(record.run_id, 0.0),
            )
            summary = summary_of_record(record, seen)
            self._progress[record.run_id] = summary.progress
        return summary


def _lives(record: RunRecord) -> bool:
    return record.alive in ("running", "stalled")


def _size(folder: Path) -> int:
    """What the files in a folder take, bytes."""
    total = 0
    for path in folder.rglob("*"):
        with suppress(OSError):  # it has just been removed
            found = path.lstat()
            total += found.st_size if stat.S_ISREG(found.st_mode) else 0
    return total
