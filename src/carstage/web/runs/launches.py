"""Runs that were asked for here: a folder for each, so that a new server finds them again.

``STATE/launches/<run_id>/``: ``config.yaml`` (frozen when it was asked for), ``launch.json``,
``output.log`` of the command. What has no process yet waits in the queue, in the order of asking.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from carstage.files.whole import write_whole
from carstage.storage.address import dataset_root
from carstage.storage.remote_path import DatasetPath
from carstage.web.messages.base import Document

if TYPE_CHECKING:
    from carstage.runs.launching import RunOptions

_TAIL_BYTES = 4000
Start = Callable[..., subprocess.Popen[bytes]]


@dataclass(frozen=True, slots=True)
class Launch:
    """One run that was asked for.

    Attributes:
        out: place of its dataset.
        server: key of the server that it needs.
        asked: Unix time.
        append: record also beside episodes of other settings.
        process: which process it is, once it has one; see ``carstage.runs.identity``.
        stop: how often it was asked to stop.
        withdrawn: it left the queue before it had a process.
        workers, catalog, work: as ``RunOptions`` has them.
        continues: the run that this one goes on with.
        ended: when its process ended, Unix time; None: it has not, or nobody was there to see it.
        has_folder: the run's own folder was seen, so that it tells how the run is; without one, the
            command has ended before it made one.
    """

    run_id: str
    out: str
    name: str
    server: str
    asked: float
    retries: int
    append: bool = False
    process: Document | None = None
    stop: int = 0
    withdrawn: bool = False
    workers: int | Literal["auto"] = 1
    catalog: str | None = None
    work: str | None = None
    continues: str | None = None
    ended: float | None = None
    has_folder: bool = False

    @property
    def options(self) -> RunOptions:
        """What its command is given."""
        from carstage.runs.launching import RunOptions

        return RunOptions(self.retries, self.append, self.workers, self.catalog, self.work)

    @property
    def place(self) -> DatasetPath:
        """Where its dataset is."""
        return dataset_root(self.out)

    @property
    def queued(self) -> bool:
        """Whether it waits."""
        return self.process is None and not self.withdrawn


def identify_child(pid: int) -> Document:
    """Which process a child is; of one that has ended already, its id and the time."""
    from psutil import Error

    from carstage.runs.identity import identify

    try:
        return identify(pid)
    except Error:
        return {"pid": pid, "pid_started": time.time()}


class Launches:
    """The launches of a state folder; safe to use from several threads.

    Args:
        folder: ``STATE/launches``; made when missing.
        root: what relative paths in configurations are relative to.
        start: starts a run's process; default: ``carstage.runs.launching.launch``.
    """

    def __init__(self, folder: Path, root: Path, start: Start | None = None) -> None:
        self._folder = folder
        self._root = root
        self._start = start
        self._lock = threading.RLock()
        folder.mkdir(parents=True, exist_ok=True)
        self._launches = {launch.run_id: launch for launch in self._kept()}

    def all(self) -> list[Launch]:
        """All, oldest first."""
        with self._lock:
            return sorted(self._launches.values(), key=lambda launch: launch.asked)

    def get(self, run_id: str) -> Launch | None:
        """One, or None for a run that was not asked for here."""
        with self._lock:
            return self._launches.get(run_id)

    def queue(self, launch: Launch, config: Document) -> None:
        """Put a run with its configuration at the end of the queue."""
        with self._lock:
            folder = self._folder / launch.run_id
            folder.mkdir()
            text = json.dumps(config, indent=1, ensure_ascii=False)  # JSON is YAML
            (folder / "config.yaml").write_text(text + "\n", "utf-8")
            self._keep(launch)

    def begin(self, run_id: str) -> None:
        """Start the process of a queued run."""
        from carstage.runs.launching import launch

        with self._lock:
            waiting = self._launches[run_id]
            folder = self._folder / run_id
            child = (self._start or launch)(
                folder / "config.yaml",
                waiting.out,
                run_id,
                folder / "output.log",
                options=waiting.options,
                folder=self._root,
            )
            begun = replace(waiting, process=identify_child(child.pid))
            # Whether it can be written or not, as on a full disk: it is begun only once.
            self._launches[run_id] = begun
            # Waited for, or it would stay as a zombie; its status file holds how it ended.
            threading.Thread(
                target=self._await, args=(run_id, child), name=f"run {run_id}", daemon=True
            ).start()
            self._keep(begun)

    def _await(self, run_id: str, child: subprocess.Popen[bytes]) -> None:
        child.wait()
        with self._lock:
            launch = self._launches.get(run_id)
            if launch is not None:
                self._launches[run_id] = replace(launch, ended=time.time())
                self._keep(self._launches[run_id])

    def stop_asked(self, run_id: str) -> None:
        """Remember that a run was asked to stop; a queued one is withdrawn."""
        with self._lock:
            launch = self._launches.get(run_id)
            if launch is not None:
                self._keep(replace(launch, stop=launch.stop + 1, withdrawn=launch.process is None))

    def folder_seen(self, run_id: str) -> None:
        """Remember that a run has made its folder."""
        with self._lock:
            launch = self._launches.get(run_id)
            if launch is not None and not launch.has_folder:
                self._launches[run_id] = replace(launch, has_folder=True)
                with suppress(OSError):  # a full disk hides no list of runs
                    self._keep(self._launches[run_id])

    def rename(self, run_id: str, name: str) -> None:
        """Show a run by another name."""
        with self._lock:
            launch = self._launches.get(run_id)
            if launch is not None:
                self._keep(replace(launch, name=name))

    def remove(self, run_id: str) -> None:
        """Forget a run that goes on no more, with its frozen configuration."""
        with self._lock:
            if self._launches.pop(run_id, None) is not None:
                shutil.rmtree(self._folder / run_id)

    def folder(self, run_id: str) -> Path:
        """What is kept of a run here."""
        return self._folder / run_id

    def ended_s(self, launch: Launch) -> float | None:
        """When its process ended, Unix time; as a last resort when it last said something."""
        if launch.ended is not None:
            return launch.ended
        with suppress(OSError):
            return (self._folder / launch.run_id / "output.log").stat().st_mtime
        return None

    def alive(self, launch: Launch) -> bool:
        """Whether its process lives."""
        from carstage.runs.identity import is_alive

        return launch.process is not None and is_alive(launch.process)

    def config(self, run_id: str) -> Document:
        """The frozen configuration."""
        document: Document = json.loads((self._folder / run_id / "config.yaml").read_bytes())
        return document

    def output_tail(self, run_id: str) -> str:
        """The last lines that its command printed."""
        try:
            with (self._folder / run_id / "output.log").open("rb") as log:
                size = log.seek(0, os.SEEK_END)
                log.seek(max(0, size - _TAIL_BYTES))
                return log.read().decode("utf-8", "replace").strip()
        except OSError:
            return ""

    def _keep(self, launch: Launch) -> None:
        path = self._folder / launch.run_id / "launch.json"
        write_whole(path, json.dumps(asdict(launch)).encode())
        self._launches[launch.run_id] = launch

    def _kept(self) -> list[Launch]:
        found = []
        for path in sorted(self._folder.glob("*/launch.json")):
            try:
                document: Any = json.loads(path.read_bytes())
                found.append(Launch(**document))
            except (OSError, ValueError, TypeError):
                continue  # of another version, or not whole: the run's own folder is still read
        return found
