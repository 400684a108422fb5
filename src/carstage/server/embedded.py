"""The embedded simulator, started as a process like any other server."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from carstage.errors import ServerEndedError, ServerError
from carstage.sensor_kinds import simulator_plugins
from carstage.server.base import TAIL_LINES, Endpoint
from carstage.server.owned import OwnedServer
from carstage.server.ports import ANY_PORTS, PortRange, check_ports_free, free_port
from carstage.server.process import ServerProcess

MODULE = "carstage_sim"
PORTS = 2
"""RPC and streaming, in a row."""

START_S = 900.0
"""The first start on a machine computes the map and compiles the kernels: about a minute of work,
many on a machine that others use. One that ends meanwhile is noticed at once."""

_READY = re.compile(
    rf"{MODULE} ready rpc=(?P<host>\S+):(?P<port>\d+) .*\bprotocol=(?P<version>\S+)"
)


def plugin_options() -> list[str]:
    """Options that make the simulator import the sensors of the packages installed here."""
    return [word for module in simulator_plugins() for word in ("--plugin", module)]


class EmbeddedServer(OwnedServer):
    """``python -m carstage_sim``; ends by itself when this process is gone.

    Args:
        map_name: the map that it begins with; None leaves the choice to it.
        port: RPC port, the streaming port follows; None lets the system choose both.
        threads: threads that it computes with; None: one for each core, of eight and more one less.
        host: the address to listen on.
        log_path: file that its output is appended to; None uses a temporary one.
        timeout_s: how long it may take until it is ready.
        environment: added to its environment.
        arguments: further ones of ``carstage sim``, such as ``("--loop", "2")``.
        traffic_manager_ports: where to look for the port of the client's Traffic Manager.
    """

    kind: ClassVar[str] = "embedded"

    def __init__(
        self,
        *,
        map_name: str | None = None,
        port: int | None = None,
        threads: int | None = None,
        host: str = "127.0.0.1",
        log_path: Path | None = None,
        timeout_s: float = START_S,
        environment: Mapping[str, str] | None = None,
        arguments: Sequence[str] = (),
        traffic_manager_ports: PortRange = ANY_PORTS,
    ) -> None:
        super().__init__()
        self._map_name = map_name
        self._port = port
        self._threads = threads
        self._host = host
        self._log_path = log_path
        self._timeout_s = timeout_s
        self._environment = environment
        self._arguments = tuple(arguments)
        self._traffic_manager_ports = traffic_manager_ports

    def start(self) -> Endpoint:
        """Start it and wait for its ready line."""
        if self._port is not None:
            check_ports_free(range(self._port, self._port + PORTS), self._host)
        begin_s = time.monotonic()
        self._process = ServerProcess(
            self._command(),
            log_path=self._log_path,
            environment=self._environment,
            marker=f"{MODULE} ready",
        )
        try:
            ready = _READY.match(self._process.wait_line(self._timeout_s))
            if ready is None:
                raise self._not_ready(self._process, time.monotonic() - begin_s)
            self._endpoint = Endpoint(
                host=ready["host"],
                port=int(ready["port"]),
                traffic_manager_port=free_port(within=self._traffic_manager_ports),
                version=ready["version"],
                pid=self._process.pid,
            )
        except BaseException:
            self.kill()  # it has nothing to give back
            raise
        return self._endpoint

    def _command(self) -> list[str]:
        parent = str(os.getpid())  # given, as we may be gone before it can look
        command = [
            *(sys.executable, "-m", MODULE, "--exit-with-parent", parent),
            *("--host", self._host),
        ]
        if self._port is None:
            command += ["--port", "0", "--streaming-port", "0"]
        else:
            command += ["--port", str(self._port), "--streaming-port", str(self._port + 1)]
        if self._map_name is not None:
            command += ["--map", self._map_name]
        if self._threads is not None:
            command += ["--threads", str(self._threads)]
        return [*command, *plugin_options(), *self._arguments]

    def _not_ready(self, process: ServerProcess, after_s: float) -> ServerError:
        where = f"{self._host}:{self._port or 'auto'}"
        ended = process.wait_end(1.0) if after_s < self._timeout_s else False
        what = (
            f"ended with exit status {process.exit_code}"
            if ended
            else f"was not ready after {after_s:.0f} s"
        )
        tail = process.tail(TAIL_LINES)
        message = f"The embedded simulator at {where} {what}. Its last words:\n{tail}"
        hint = "Try `carstage sim` to see it start by itself."
        return (
            ServerEndedError(message, hint, process.exit_code)
            if ended
            else ServerError(message, hint)
        )
