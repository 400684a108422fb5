"""``carstage run`` as a process of its own, followed by the events that its run writes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import psutil

_POLL_S = 0.02
_COMMAND_PARTS = 5
"""So many words of a command show what it is: options of Python, then a module or program text."""


@dataclass(frozen=True, slots=True)
class Moment:
    """When a fault strikes.

    Attributes:
        event: name of an event of the run.
        nth: which one of that name, from 1.
        after_s: how long after it.
    """

    event: str
    nth: int = 1
    after_s: float = 0.0

    def __str__(self) -> str:
        return f"{self.event} {self.nth} + {self.after_s:.2f} s"


class RunCommand:
    """One ``carstage run``; a context manager that ends what is left of it.

    Args:
        config: the configuration file.
        out: folder of the dataset.
        settings: ``key=value`` for ``--set``.
        log: file for what it prints.
        environment: added to this process's.
        prefix: words before the command, as of a program that watches it.
        run_id: name of the run's folder; None: a new one.
    """

    def __init__(
        self,
        config: Path,
        out: Path,
        settings: Sequence[str],
        log: Path,
        environment: Mapping[str, str],
        prefix: Sequence[str] = (),
        run_id: str | None = None,
    ) -> None:
        self.out = out
        self._runs_before = set(_run_folders(out))
        self._log_path = log
        arguments = [word for setting in settings for word in ("--set", setting)]
        with log.open("wb") as output:
            self.process = subprocess.Popen(
                [
                    *(*prefix, sys.executable, "-m", "carstage.cli", "run", str(config)),
                    *("--out", str(out), "--json", *arguments),
                    *(() if run_id is None else ("--run-id", run_id)),
                ],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**os.environ, **environment},
                start_new_session=True,
            )
        self.started_s = time.time()

    def __enter__(self) -> RunCommand:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
            self.process.wait()

    @property
    def output(self) -> str:
        """What it has printed."""
        return self._log_path.read_text("utf-8", "replace")

    @property
    def run_folder(self) -> Path | None:
        """The folder of its run, once it has one."""
        new = [path for path in _run_folders(self.out) if path not in self._runs_before]
        return new[-1] if new else None

    def events(self, name: str) -> list[dict[str, Any]]:
        """The events of that name so far; lines that are not whole are left out."""
        folder = self.run_folder
        if folder is None or not (folder / "events.jsonl").exists():
            return []
        found = []
        for line in (folder / "events.jsonl").read_bytes().split(b"\n")[:-1]:
            if name.encode() in line:
                try:
                    event = json.loads(line)
                except ValueError:
                    continue
                if event["event"] == name:
                    found.append(event)
        return found

    def wait_for(self, moment: Moment, timeout_s: float) -> bool:
        """Wait for a moment; returns whether it came before the command ended."""
        deadline_s = time.monotonic() + timeout_s
        pause = threading.Event()
        while time.monotonic() < deadline_s and self.process.poll() is None:
            if len(self.events(moment.event)) >= moment.nth:
                pause.wait(moment.after_s)
                return self.process.poll() is None
            pause.wait(_POLL_S)
        return False

    def wait(self, timeout_s: float) -> int | None:
        """Its exit code, None when it does not end in time."""
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None

    def children(self, word: str) -> list[psutil.Process]:
        """Its descendants with that word at the beginning of their command line."""
        try:
            family = psutil.Process(self.process.pid).children(recursive=True)
        except psutil.Error:
            return []
        return [process for process in family if _mentions(process, word)]


def _mentions(process: psutil.Process, word: str) -> bool:
    try:
        return any(word in part for part in process.cmdline()[1:_COMMAND_PARTS])
    except psutil.Error:
        return False


def _run_folders(out: Path) -> list[Path]:
    return sorted(path for path in (out / "runs").glob("*") if path.is_dir())
