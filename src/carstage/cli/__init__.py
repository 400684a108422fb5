"""The ``carstage`` command. ``main`` checks the platform first, then loads the command line."""

from __future__ import annotations

import atexit
import gc
import os
import platform
import sys

from carstage.cli.loading import loading

_OLDEST, _TOO_NEW = (3, 10), (3, 13)
_LOOKS_FOR_GARBAGE_AFTER = 10_000
BAD_INPUT = 2
INTERRUPTED = 130


def unsupported(system: str, machine: str, version: tuple[int, int]) -> str | None:
    """Why this machine cannot run Car-STAGE, or None when it can.

    The bound is the ``carla`` client wheel 0.9.16: Linux x86-64, Python 3.10 to 3.12.
    """
    if system != "Linux" or machine not in ("x86_64", "AMD64"):
        return (
            f"Car-STAGE needs Linux on x86-64, this is {system} on {machine}: the carla client "
            "wheel exists for nothing else. Use a Linux machine or container."
        )
    if not _OLDEST <= version < _TOO_NEW:
        return (
            f"Car-STAGE needs Python 3.10, 3.11 or 3.12, this is {version[0]}.{version[1]}: the "
            "carla client wheel exists for nothing else. Install one of them, for example with "
            "`uv python install 3.12`."
        )
    return None


def _open_closed_streams() -> None:
    """Put the null device in place of standard streams that are closed.

    Else the next file that is opened would get the number of one, and what is printed its content.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free: this one
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w"))


def main() -> None:
    """Run the command line and end the process."""
    _open_closed_streams()
    problem = unsupported(platform.system(), platform.machine(), sys.version_info[:2])
    if problem is not None:
        sys.stderr.write(problem + "\n")
        raise SystemExit(BAD_INPUT)
    arguments = sys.argv[1:]
    if arguments[:1] == ["sim"]:
        os.execv(sys.executable, [sys.executable, "-m", "carstage_sim", *arguments[1:]])
    # Nothing multiplies matrices large enough to be shared out, but NumPy would have a thread for
    # each core wait for some: a tenth of a second of CPU in each of a run's processes.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Nor is there so much memory that Arrow's need be given back by a thread, some ms of each run.
    os.environ.setdefault("JE_ARROW_MALLOC_CONF", "background_thread:false")
    # Imports make objects that stay: to look through them after each 700 takes 30 ms.
    gc.set_threshold(_LOOKS_FOR_GARBAGE_AFTER)
    # What is there at the end ends with the process: Python need not look through it for garbage.
    atexit.register(gc.freeze)
    try:
        with loading():
            from carstage.cli.app import narrowed
        narrowed(arguments)()
    except KeyboardInterrupt:
        raise SystemExit(INTERRUPTED) from None
