"""The folder of a run: plan, status, events, logs, raw recordings (docs/formats/run-folder.md)."""

from __future__ import annotations

import json
import os
import re
import secrets
import socket
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal

import psutil

from carstage.errors import BadInputError
from carstage.storage.disk import disk_error

if TYPE_CHECKING:
    from carstage.config import Config
    from carstage.spec import EpisodeSpec

FORMAT_VERSION = 1
_RUN_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
State = Literal["planning", "starting", "recording", "converting", "done", "failed", "interrupted"]
FINAL_STATES = ("done", "failed", "interrupted")
FOREIGN_SILENCE_S = 900.0
"""Age of the heartbeat at which a run on another machine counts as dead; clocks may differ."""
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
class RunStatus:
    """What ``status.json`` says.

    Attributes:
        pid_started: Unix time at which the process of the run began: a pid alone may be another's.
        heartbeat: Unix time of the last write.
        host: name of the machine that the run is on; folders may be shared by several.
    """

    run_id: str
    state: State
    pid: int
    pid_started: float
    heartbeat: float
    episodes: EpisodeCounts
    current: CurrentEpisode | None = None
    message: str | None = None
    host: str = field(default_factory=socket.gethostname)

    def to_json(self) -> dict[str, Any]:
        """The content of the file."""
        return {"format_version": FORMAT_VERSION, **asdict(self)}


def new_run_id() -> str:
    """A name that no other run has: time (UTC) and chance."""
    return f"{time.strftime('%Y%m%d-%H%M%S', time.gmtime())}-{secrets.token_hex(3)}"


class RunFolder:
    """A new folder below ``OUT/runs``; a context manager that closes the event log.

    Args:
        out: folder of the dataset.
        run_id: its name, where whoever starts the run has to know it; by default a new one.
    """

    def __init__(self, out: Path, run_id: str | None = None) -> None:
        self.run_id = run_id or new_run_id()
        if not _RUN_ID.fullmatch(self.run_id):
            raise BadInputError(
                f"{self.run_id!r} cannot be a run's name.", "Use letters and digits."
            )
        self.path = out / "runs" / self.run_id
        self._torn = False
        try:
            self.logs.mkdir(parents=True)
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

    def write_plan(self, config: Config, episodes: Sequence[EpisodeSpec]) -> None:
        """Write ``plan.json``."""
        from carstage.config import dump_config

        document = {
            "format_version": FORMAT_VERSION,
            "run_id": self.run_id,
            "config": dump_config(config),
            "episodes": [
                {"episode_id": spec.episode_id, "spec": spec.to_json()} for spec in episodes
            ],
        }
        _replace(self.path / "plan.json", document)

    def write_status(self, status: RunStatus) -> None:
        """Replace ``status.json`` atomically."""
        status.heartbeat = time.time()
        _replace(self.path / "status.json", status.to_json())

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


def process_start_time(pid: int) -> float:
    """Unix time at which a process began.

    Raises:
        psutil.Error: there is no such process, or it has ended and waits to be reaped.
    """
    process = psutil.Process(pid)
    if process.status() == psutil.STATUS_ZOMBIE:
        raise psutil.NoSuchProcess(pid)
    return float(process.create_time())


def is_alive(status: Mapping[str, Any]) -> bool:
    """Whether the process of a run, by its ``status.json``, still exists.

    Of a run on another machine only its heartbeat can be seen from here.
    """
    host = status.get("host")
    if host is not None and host != socket.gethostname():
        return time.time() - float(status.get("heartbeat", 0.0)) < FOREIGN_SILENCE_S
    try:
        started = process_start_time(int(status["pid"]))
    except (psutil.Error, KeyError, TypeError, ValueError):
        return False
    if abs(started - float(status.get("pid_started", started))) < 1.0:
        return True
    # Another process has its number now, or the clock was set; who lives says so every second.
    return abs(time.time() - float(status.get("heartbeat", 0.0))) < RESTED_S


def _replace(path: Path, document: Mapping[str, Any]) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", "utf-8")
        temporary.replace(path)
    except OSError as error:
        raise disk_error(error, str(path)) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
