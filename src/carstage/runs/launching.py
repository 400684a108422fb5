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
from pathlib import Path
from typing import Any

import psutil

from carstage.errors import CarStageError
from carstage.runs.folder import process_start_time
from carstage.runs.reading import is_here

_SAME_S = 1.0


class StopError(CarStageError, RuntimeError):
    """A run cannot be asked to stop from here."""


def launch(
    config: Path, out: Path, run_id: str, log: Path, *, retries: int, folder: Path
) -> subprocess.Popen[bytes]:
    """Start ``carstage run`` and return at once.

    Args:
        config: file with the configuration.
        out: folder of the dataset.
        run_id: name of the run's folder.
        log: file that its output is appended to.
        retries: further attempts of an episode that fails.
        folder: what relative paths in the configuration are relative to.
    """
    command = [
        *(sys.executable, "-m", "carstage.cli", "run", str(config), "--out", str(out)),
        *("--run-id", run_id, "--retries", str(retries)),
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
    """Send a run the signal of Ctrl-C: the first one finishes the frame, the second ends at once.

    Args:
        status: ``pid``, ``pid_started`` and ``host`` as in ``status.json``.

    Raises:
        StopError: it is on another machine, or its process is gone.
    """
    if not is_here(status):
        raise StopError("The run is on another machine.", "Stop it there.")
    try:
        pid = int(status["pid"])
        same = abs(process_start_time(pid) - float(status["pid_started"])) < _SAME_S
    except (psutil.Error, KeyError, TypeError, ValueError):
        same = False
    if not same:
        raise StopError("The process of the run is gone.", "The next run clears up after it.")
    with suppress(ProcessLookupError):  # it ended by itself meanwhile
        os.kill(pid, signal.SIGINT)
