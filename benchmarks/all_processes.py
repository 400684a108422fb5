"""Runs a command with all that it starts below one process, and counts their CPU time.

    python benchmarks/all_processes.py COMMAND...

A process whose parent has ended before it goes to the first one of the system. Here it comes to
this program, which waits for it: so whoever looks finds it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import psutil

_TOGETHER = (sys.executable, str(Path(__file__).resolve()))
_LOOK_S = 0.25
_PR_SET_CHILD_SUBREAPER = 36
_END_S = 120


def run_counted(command: Sequence[str], log: Path) -> tuple[int, float]:
    """Run a command to the end of all its processes.

    What the kernel adds up over children is not enough: it forgets those of a process that does not
    wait for them, as Ray's. So they are looked at, four times in a second.

    Args:
        command: what is run.
        log: file for what it says.

    Returns:
        Its exit status, and the CPU seconds of all its processes.
    """
    spent_s: dict[tuple[int, float], float] = {}
    with log.open("wb") as output:
        process = psutil.Popen(
            [*_TOGETHER, *command], stdin=subprocess.DEVNULL, stdout=output, stderr=output
        )
    while True:
        with suppress(psutil.Error):
            for one in process.children(recursive=True):
                with suppress(psutil.Error):
                    times = one.cpu_times()
                    spent_s[one.pid, one.create_time()] = times.user + times.system
        with suppress(psutil.TimeoutExpired):
            return int(process.wait(_LOOK_S)), sum(spent_s.values())


def main() -> int:
    """Run the command; returns its exit status."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    code = subprocess.run(sys.argv[1:]).returncode
    signal.alarm(_END_S)  # ends this program, and so the measurement, if something stays
    while True:
        try:
            os.wait()
        except ChildProcessError:
            return code


if __name__ == "__main__":
    sys.exit(main())
