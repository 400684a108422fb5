"""The folder of a run: plan, status, events, logs, raw recordings (docs/formats/run-folder.md)."""

from __future__ import annotations

import json
import os
import re
import secrets
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal

from carstage.errors import BadInputError
from carstage.files.whole import flush_folder, make_folders
from carstage.runs.identity import identify
from carstage.storage.disk import disk_error

if TYPE_CHECKING:
    from carstage.config import Config
    from carstage.plan import EpisodePlan

FORMAT_VERSION = 1
SHORT_PLAN_VERSION = 2
"""Of a ``plan.json`` whose episodes have ids and sizes alone."""
MOST_WITH_SPECS = 1000
"""Episodes up to which ``plan.json`` holds the specification of each."""
_RUN_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
State = Literal["planning", "starting", "recording", "converting", "done", "failed", "interrupted"]
FINAL_STATES = ("done", "failed", "interrupted")
PROCESS_FILE = "process.json"
INPUTS_FILE = "driving/inputs.json"
"""What a driver at the page presses; its server writes it, whole each time."""
RESTED_S = 60.0
"""A run's heartbeat may rest for so long while it commits an episode."""


@dataclass(slots=True)
class EpisodeCounts:
    """How many episodes are in which state."""

    total: int = 0
    committed: int = 0
    failed: int = 0
    skipped: int = 0


@dataclass(slots=True)
class CurrentEpisode:
    """The episode that is being recorded or converted."""

    episode_id: str
    index: int
    attempt: str
    ticks_done: int = 0
    ticks_total: int = 0
    frames_converted: int = 0
    frames_total: int = 0


@dataclass(slots=True)
class WorkerStatus:
    """One of several workers of a run.

    Attributes:
        worker: its number, from 1.
        state: what it does.
        process: which process it is, see ``identity.identify``.
        current: the episode that it records or converts.
    """

    worker: int
    state: State
    process: Mapping[str, Any]
    current: CurrentEpisode | None = None


@dataclass(slots=True)
class RunStatus:
    """What ``status.json`` says.

    Attributes:
        process: which process the run is, see ``identity.identify``.
        heartbeat: Unix time of the last write.
        workers: each of several workers; empty where the run itself records.
        eta_s: seconds that the rest will take at the pace so far; None: not known, or one worker.
    """

    run_id: str
    state: State
    process: Mapping[str, Any]
    heartbeat: float
    episodes: EpisodeCounts
    current: CurrentEpisode | None = None
    message: str | None = None
    workers: list[WorkerStatus] = field(default_factory=list)
    eta_s: float | None = None

    def to_json(self) -> dict[str, Any]:
        """The content of the file."""
        fields = asdict(self)
        return {"format_version": FORMAT_VERSION, **fields.pop("process"), **fields}


def new_run_id() -> str:
    """A name that no other run has: time (UTC) and chance."""
    return f"{time.strftime('%Y%m%d-%H%M%S', time.gmtime())}-{secrets.token_hex(3)}"


class RunFolder:
    """A new folder below ``runs``; a context manager that closes the event log.

    Which process the run is, is on the disk before anything else is.

    Args:
        work: what holds the folder ``runs``: the dataset's own, or one on this machine.
        run_id: its name, where whoever starts the run has to know it; by default a new one.
        process: which process the run is; default: this one.
    """

    def __init__(
        self, work: Path, run_id: str | None = None, process: Mapping[str, Any] | None = None
    ) -> None:
        self.run_id = run_id or new_run_id()
        if not _RUN_ID.fullmatch(self.run_id):
            raise BadInputError(
                f"{self.run_id!r} cannot be a run's name.", "Use letters and digits."
            )
        self.work = work
        self.path = work / "runs" / self.run_id
        self.process = identify() if process is None else process
        self._torn = False
        try:
            make_folders(self.path.parent)
            self.path.mkdir()
            _replace(self.path / PROCESS_FILE, self.process, durable=True)
            flush_folder(self.path.parent)
            self.logs.mkdir()
            self.raw.mkdir()
            self._events: FileIO = (self.path / "events.jsonl").open("ab", buffering=0)
        except OSError as error:
            raise disk_error(error, f"the run's folder {self.path}") from error

    def __enter__(self) -> RunFolder:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._events.close()
        with suppress(OSError):  # kept when recordings are kept
            self.raw.rmdir()

    @property
    def logs(self) -> Path:
        """Folder of the logs of server and collector."""
        return self.path / "logs"

    @property
    def raw(self) -> Path:
        """Folder of the raw recordings."""
        return self.path / "raw"

    def raw_attempt(self, episode_id: str, attempt: str) -> Path:
        """Folder of one attempt's raw recording."""
        return self.raw / episode_id / attempt

    def write_plan(
        self,
        config: Config,
        episodes: EpisodePlan,
        environment: Mapping[str, str],
        shard: str | None = None,
    ) -> None:
        """Write ``plan.json``, of many episodes in its short form.

        Args:
            config: as resolved.
            episodes: what this run is about.
            environment: what they are made with, by version.
            shard: which share of the configuration's episodes they are, as ``2/8``; None: all.
        """
        from carstage.config import dump_config

        whole = len(episodes) <= MOST_WITH_SPECS
        document = {
            "format_version": FORMAT_VERSION if whole else SHORT_PLAN_VERSION,
            "run_id": self.run_id,
            "config": dump_config(config),
            "environment": dict(environment),
            "shard": shard,
        }
        if whole:
            document["episodes"] = [
                {"episode_id": spec.episode_id, "spec": spec.to_json()} for spec in episodes
            ]
        else:
            document["first_spec"] = episodes[0].to_json()
            document["steps"] = int(episodes.costs["steps"].sum())
            document["saved_frames"] = episodes.frames
            document["episodes"] = [{"episode_id": one} for one in episodes.ids]
        _replace(self.path / "plan.json", document, durable=True)

    def write_status(self, status: RunStatus, *, durable: bool = False) -> None:
        """Replace ``status.json`` atomically.

        Args:
            status: its content.
            durable: it is on the disk on return. A heartbeat need not be: after a power cut the
                file may be empty, and ``process.json`` still tells that the run is dead.
        """
        status.heartbeat = time.time()
        _replace(self.path / "status.json", status.to_json(), durable=durable)

    def write_event(self, event: str, fields: Mapping[str, Any]) -> dict[str, Any]:
        """Append one event, with its time unless it brings one; returns the line's content."""
        line = {"time": fields.get("time", time.time()), "event": event}
        line.update({key: value for key, value in fields.items() if key not in line})
        data = (json.dumps(line, ensure_ascii=False) + "\n").encode()
        try:
            # Unbuffered: of a line that finds no room, nothing stays to be tried again.
            if self._torn:
                self._events.write(b"\n")
            self._torn = True
            while data:
                data = data[self._events.write(data) :]
            self._torn = False
        except OSError as error:
            raise disk_error(error, f"{self.path / 'events.jsonl'}") from error
        return line


def _replace(path: Path, document: Mapping[str, Any], *, durable: bool) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with temporary.open("w", encoding="utf-8") as file:
            # In pieces: the plan of many episodes is long.
            file.writelines(json.JSONEncoder(indent=1, ensure_ascii=False).iterencode(document))
            file.write("\n")
            if durable:
                file.flush()
                os.fsync(file.fileno())
        temporary.replace(path)
        if durable:
            flush_folder(path.parent)
    except OSError as error:
        raise disk_error(error, str(path)) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
