"""The process of one bake: ``python -m carstage_sim.maps.bake_process JOB ANSWER``.

JOB says what to bake and how much memory it may take; into ANSWER goes what is wrong with it, or
null. Standard input is a pipe that the server holds: when it ends, the server is gone, however that
came about, and nobody waits any more or would clear the folder that both files are in.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import resource
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from carstage_sim.maps.background import BAKING_LOG
from carstage_sim.maps.baking import BakeOptions
from carstage_sim.maps.checking import MapSamplingError
from carstage_sim.maps.loading import TownSource, town_of

_NICENESS = 10
"""Clients that tick the world go first where cores are few."""
_BACKSTOP = 2
"""How many times what a bake may hold it can ask for: the server looks now and then, and what asks
for far too much at once fails loudly. Nearer, libraries go on with what they did not get."""


def main(arguments: Sequence[str]) -> int:
    """Bake what the job file says; the exit status of the process."""
    job, answer = (Path(argument) for argument in arguments)
    os.nice(_NICENESS)
    abandoned = threading.Event()
    try:
        signal.signal(signal.SIGTERM, _exit)  # so that files are cleared away on the way out
        # The server may be gone already: the signal can come before the thread's start returns.
        threading.Thread(target=_end_without_server, args=(abandoned,), daemon=True).start()
        _bake(job, answer)
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        if abandoned.is_set():
            _clear_away(job, answer)
    return 0


def _bake(job: Path, answer: Path) -> None:
    record = json.loads(job.read_text(encoding="utf-8"))
    logging.basicConfig(format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    logging.getLogger(BAKING_LOG).setLevel(record["level"])
    options = BakeOptions(**record["source"].pop("options"))
    refusal = None
    # Private writable memory only: of addresses, the libraries reserve far more than they use.
    most_bytes = record["most_bytes"] * _BACKSTOP
    resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, most_bytes))
    try:
        folder = Path(record["cache_folder"]) if record["cache_folder"] else None
        town_of(TownSource(**record["source"], options=options), cache_folder=folder)
    except MapSamplingError as error:
        refusal = str(error)
    except MemoryError as error:
        refusal = repr(error)
    answer.write_text(json.dumps(refusal), encoding="utf-8")


def _clear_away(*files: Path) -> None:
    """Remove the two files, and the folder that was made for them if nothing else is in it."""
    with contextlib.suppress(OSError):
        for file in files:
            file.unlink(missing_ok=True)
        files[0].parent.rmdir()


def _exit(number: int, _frame: FrameType | None) -> None:
    sys.exit(128 + number)


def _end_without_server(abandoned: threading.Event) -> None:
    # Not through sys.stdin, whose lock must be free when the interpreter ends.
    os.read(0, 1)
    abandoned.set()
    # The process that reads the lanes is of the same group, which is ours if the server made it.
    if os.getpgrp() == os.getpid():
        os.killpg(os.getpid(), signal.SIGTERM)
    else:
        os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
