"""The simulator as a process of its own, found by the port in its ready line."""

from __future__ import annotations

import re
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from queue import Empty, Queue
from time import monotonic

_READY = re.compile(r"ready rpc=\S*:(\d+)")
_STOP_TIMEOUT_S = 10.0
_LOG_LINES = 40


class ServerError(RuntimeError):
    """The server did not start, or died; the message holds the end of its output."""


@contextmanager
def running_server(
    arguments: Sequence[str] = (), *, start_timeout_s: float = 180.0
) -> Iterator[int]:
    """Runs ``python -m carstage_sim --port 0`` and yields its port; it ends with the block.

    Args:
        arguments: further arguments of the server.
        start_timeout_s: the first start bakes the map and compiles kernels.

    Raises:
        ServerError: no ready line within the time.
    """
    command = [sys.executable, "-m", "carstage_sim", "--port", "0", "--exit-with-parent"]
    process = subprocess.Popen(
        [*command, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    lines: Queue[str | None] = Queue(maxsize=10_000)
    tail: deque[str] = deque(maxlen=_LOG_LINES)
    reader = threading.Thread(target=_read, args=(process, lines, tail), daemon=True)
    reader.start()
    try:
        yield _await_port(lines, tail, monotonic() + start_timeout_s)
    finally:
        process.terminate()
        try:
            process.wait(_STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        reader.join()


def _read(process: subprocess.Popen[str], lines: Queue[str | None], tail: deque[str]) -> None:
    """Drains the server's output, so that it never blocks on a full pipe."""
    assert process.stdout is not None
    waiting = True
    for line in process.stdout:
        tail.append(line.rstrip())
        if waiting:
            lines.put(line)
            waiting = _READY.search(line) is None
    process.stdout.close()
    lines.put(None)


def _await_port(lines: Queue[str | None], tail: deque[str], deadline: float) -> int:
    while True:
        try:
            line = lines.get(timeout=max(deadline - monotonic(), 0.0))
        except Empty:
            raise ServerError(
                "the server gave no ready line in time:\n" + "\n".join(tail)
            ) from None
        if line is None:
            raise ServerError("the server ended before it was ready:\n" + "\n".join(tail))
        found = _READY.search(line)
        if found is not None:
            return int(found.group(1))
