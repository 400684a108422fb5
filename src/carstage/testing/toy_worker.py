"""``python -m carstage.testing.toy_worker``: a slot that needs no server; for executors' tests.

A job is ``{"key", "do"}``. ``square``: says the square of the key. ``die``: its process dies in the
first such job of a folder, and squares in later ones. ``fail``: an error that ends the run.
``no_server``: as ``die``, but it says that this place has no server. ``wait``: until it is
interrupted.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from carstage.errors import DiskFullError, ServerError
from carstage.execution.slot_line import SlotLine


def first_time(folder: Path, key: str) -> bool:
    """Whether nobody has asked this before in this folder."""
    try:
        (folder / f"began-{key}").touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def do(job: Mapping[str, Any], folder: Path) -> int:
    """Do a job; returns the square of its key."""
    key, what = str(job["key"]), job["do"]
    if what == "fail":
        raise DiskFullError("There is no space left.", "Make room.")
    if what == "die" and first_time(folder, key):
        os.kill(os.getpid(), signal.SIGKILL)
    if what == "no_server" and first_time(folder, key):
        raise ServerError("There is no server here.")
    if what == "wait":
        threading.Event().wait()
    return int(key) ** 2


def main() -> int:
    """Be a slot; returns the exit status."""
    line = SlotLine()
    folder = Path(line.next()["setup"]["folder"])
    line.send("here", pid=os.getpid())
    print("What a worker prints does not get into its line.")  # noqa: T201
    line.send("want")
    while "end" not in (message := line.next()):
        if "job" not in message:
            continue
        job = message["job"]
        line.send("began", key=job["key"])
        try:
            result = do(job, folder)
        except (DiskFullError, ServerError) as error:
            line.send_error(error)
            return 1
        line.send("result", key=job["key"], value=result)
        line.send("done", key=job["key"])
        line.send("want")
    return 0


if __name__ == "__main__":
    try:
        code = main()
    except KeyboardInterrupt:
        code = 130
    sys.stderr.flush()
    os._exit(code)
