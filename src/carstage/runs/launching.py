"""Starts a run as a process of its own, and asks one to stop.

The process is the command line's own ``carstage run``, in a session of its own: whoever started it
may end, be killed or start anew; the run's folder says all that there is to know.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from carstage.errors import CarStageError
from carstage.runs.identity import life_of


class StopError(CarStageError, RuntimeError):
    """A run cannot be asked to stop from here."""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What ``carstage run`` is given besides the configuration and the dataset's place.

    Attributes:
        retries: further attempts of an episode that fails.
        append: record also beside episodes of other settings.
        workers: servers on this machine.
        catalog: address of a catalog to write to, too; it holds no password.
        work: folder of this machine for raw recordings and logs.
    """

    retries: int = 2
    append: bool = False
    workers: int | Literal["auto"] = 1
    catalog: str | None = None
    work: str | None = None

    def arguments(self) -> list[str]:
        """The options of the command line that differ from its own defaults."""
        given = []
        if self.retries != RunOptions().retries:
            given += ["--retries", str(self.retries)]
        if self.append:
            given.append("--append")
        if self.workers != 1:
            given += ["--workers", str(self.workers)]
        if self.catalog:
            given += ["--catalog", self.catalog]
        if self.work:
            given += ["--work", self.work]
        return given


def launch(
    config: Path, out: str, run_id: str, log: Path, *, options: RunOptions, folder: Path
) -> subprocess.Popen[bytes]:
    """Start ``carstage run`` and return at once.

    Args:
        config: file with the configuration.
        out: place of the dataset.
        run_id: name of the run's folder.
        log: file that its output is appended to.
        options: as ``carstage run`` has them.
        folder: what relative paths in the configuration are relative to.
    """
    command = [
        *(sys.executable, "-m", "carstage.cli", "run", str(config), "--out", out),
        *("--run-id", run_id, *options.arguments()),
    ]
    with log.open("ab") as output:
        return subprocess.Popen(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )


def ask_to_stop(status: Mapping[str, Any]) -> None:
    """Send a run the signal of Ctrl-C: the first one ends it well, the second at once.

    Args:
        status: as in ``status.json``, or what ``identity.identify`` gave.

    Raises:
        StopError: it cannot be seen from here, or its process is gone.
    """
    life = life_of(status)
    if life == "unknown":
        raise StopError("The run is on another machine or in another container.", "Stop it there.")
    if life == "dead":
        raise StopError("The process of the run is gone.", "The next run clears up after it.")
    with suppress(ProcessLookupError):  # it ended by itself meanwhile
        os.kill(int(status["pid"]), signal.SIGINT)
