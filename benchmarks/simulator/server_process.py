"""The simulator as a process, with what checks ask of it: its ports, its log, how it ended."""

from __future__ import annotations

import os
import signal
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

from carstage.server import EmbeddedServer, allot_ports

_ABORT_TIMEOUT_S = 10.0
_POLL_S = 0.05


@dataclass(frozen=True)
class RunningServer:
    """A server process.

    Attributes:
        port: RPC port on the loopback interface; the streaming port follows it.
        pid: its process.
    """

    port: int
    pid: int
    _server: EmbeddedServer
    _log_path: Path

    @property
    def streaming_port(self) -> int:
        """Where sensor streams are served."""
        return self.port + 1

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._server.alive()

    @property
    def exit_code(self) -> int | None:
        """Exit status of the process, negative for a signal; None while it runs."""
        return self._server.exit_code

    @property
    def log(self) -> list[str]:
        """The lines that it has printed so far."""
        return self._log_path.read_text("utf-8", "replace").splitlines()

    def abort(self) -> None:
        """End a server that hangs; its log then shows where each of its threads was."""
        os.kill(self.pid, signal.SIGABRT)
        deadline_s, pause = monotonic() + _ABORT_TIMEOUT_S, threading.Event()
        while self.alive and monotonic() < deadline_s:
            pause.wait(_POLL_S)


@contextmanager
def started_server(
    arguments: Sequence[str] = (), *, start_timeout_s: float = 300.0
) -> Iterator[RunningServer]:
    """Runs ``python -m carstage_sim``; it ends with the block.

    Args:
        arguments: further arguments of the server.
        start_timeout_s: the first start bakes the map and compiles kernels.

    Raises:
        carstage.errors.ServerError: no ready line within the time.
    """
    with tempfile.TemporaryDirectory(prefix="carstage-server-") as folder:
        log_path = Path(folder) / "server.log"
        server = EmbeddedServer(
            port=allot_ports().rpc,
            log_path=log_path,
            timeout_s=start_timeout_s,
            environment={"PYTHONFAULTHANDLER": "1"},
            arguments=arguments,
        )
        with server:
            endpoint = server.endpoint
            assert endpoint.pid is not None
            yield RunningServer(endpoint.port, endpoint.pid, server, log_path)


@contextmanager
def running_server(
    arguments: Sequence[str] = (), *, start_timeout_s: float = 300.0
) -> Iterator[int]:
    """As :func:`started_server`, for those who need its port only."""
    with started_server(arguments, start_timeout_s=start_timeout_s) as server:
        yield server.port
