"""The simulator as a process of its own, found by the port in its ready line."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from queue import Empty, Queue
from time import monotonic

_READY = re.compile(r"ready rpc=\S*:(\d+) streaming=(\d+) .*pid=(\d+)")
_STOP_TIMEOUT_S = 10.0
_TAIL_LINES = 40
_LOG_LINES = 20_000


class ServerError(RuntimeError):
    """The server did not start, or died; the message holds the end of its output."""


@dataclass(frozen=True)
class RunningServer:
    """A server process.

    Attributes:
        port, streaming_port: where it listens on the loopback interface.
        pid: its process.
        log: what it has printed so far; at most the last 20,000 lines.
    """

    port: int
    streaming_port: int
    pid: int
    log: deque[str]
    process: subprocess.Popen[str]

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self.process.poll() is None

    def abort(self) -> None:
        """End a server that hangs; its log then tells where each of its threads was."""
        self.process.send_signal(signal.SIGABRT)
        self.process.wait(_STOP_TIMEOUT_S)


@contextmanager
def started_server(
    arguments: Sequence[str] = (), *, start_timeout_s: float = 300.0
) -> Iterator[RunningServer]:
    """Runs ``python -m carstage_sim --port 0``; it ends with the block.

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
        env={**os.environ, "PYTHONFAULTHANDLER": "1"},
    )
    lines: Queue[str | None] = Queue(maxsize=10_000)
    log: deque[str] = deque(maxlen=_LOG_LINES)
    reader = threading.Thread(target=_read, args=(process, lines, log), daemon=True)
    reader.start()
    try:
        ready = _await_ready(lines, log, monotonic() + start_timeout_s)
        port, streaming_port, pid = (int(number) for number in ready.groups())
        yield RunningServer(port, streaming_port, pid, log, process)
    finally:
        process.terminate()
        try:
            process.wait(_STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        reader.join()


@contextmanager
def running_server(
    arguments: Sequence[str] = (), *, start_timeout_s: float = 300.0
) -> Iterator[int]:
    """As :func:`started_server`, for those who need its port only."""
    with started_server(arguments, start_timeout_s=start_timeout_s) as server:
        yield server.port


def _read(process: subprocess.Popen[str], lines: Queue[str | None], log: deque[str]) -> None:
    """Drains the server's output, so that it never blocks on a full pipe."""
    assert process.stdout is not None
    waiting = True
    for line in process.stdout:
        log.append(line.rstrip())
        if waiting:
            lines.put(line)
            waiting = _READY.search(line) is None
    process.stdout.close()
    lines.put(None)


def _await_ready(lines: Queue[str | None], log: deque[str], deadline: float) -> re.Match[str]:
    while True:
        try:
            line = lines.get(timeout=max(deadline - monotonic(), 0.0))
        except Empty:
            raise ServerError("the server gave no ready line in time:\n" + _tail(log)) from None
        if line is None:
            raise ServerError("the server ended before it was ready:\n" + _tail(log))
        found = _READY.search(line)
        if found is not None:
            return found


def _tail(log: deque[str]) -> str:
    return "\n".join(list(log)[-_TAIL_LINES:])
