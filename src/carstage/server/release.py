"""A CARLA release on this machine, started through its own script."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from carstage.errors import BadInputError, ServerEndedError, ServerError
from carstage.server.base import TAIL_LINES, Endpoint
from carstage.server.owned import OwnedServer
from carstage.server.ports import ANY_PORTS, PortRange, allot_ports
from carstage.server.probe import wait_for_version, wait_for_world
from carstage.server.process import ServerProcess

SCRIPT = "CarlaUE4.sh"
START_S = 180.0
_SIGNALLED = 128


def find_script(path: Path) -> Path:
    """The start script of a CARLA release: ``path`` itself, or in the folder ``path``.

    Raises:
        BadInputError: there is none; names ``server.path``.
    """
    script = path / SCRIPT if path.is_dir() else path
    if script.name != SCRIPT or not script.is_file() or not os.access(script, os.X_OK):
        what = "cannot be run" if script.name == SCRIPT and script.is_file() else "is missing"
        raise BadInputError(
            f"server.path: there is no CARLA server in {path}: {SCRIPT} {what}.",
            f"Give the folder of a CARLA release, the one with {SCRIPT}, or use server.kind: "
            "embedded.",
        )
    return script


class CarlaServer(OwnedServer):
    """``CarlaUE4.sh`` without a window, in a process group of its own.

    Args:
        path: folder of the release, or its start script.
        port: RPC port, the two after it are its too; None finds a free block.
        arguments: more arguments of the start script.
        graphics_adapter: index of the GPU; None leaves the choice to it.
        log_path: file that its output is appended to; None uses a temporary one.
        timeout_s: how long it may take until it answers.
        environment: added to its environment.
        ports: where to look for free ones.

    Raises:
        BadInputError: there is no CARLA server at ``path``.
    """

    kind: ClassVar[str] = "carla"

    def __init__(
        self,
        path: Path,
        *,
        port: int | None = None,
        arguments: Sequence[str] = ("-RenderOffScreen",),
        graphics_adapter: int | None = None,
        log_path: Path | None = None,
        timeout_s: float = START_S,
        environment: Mapping[str, str] | None = None,
        ports: PortRange = ANY_PORTS,
    ) -> None:
        super().__init__()
        self._ports = ports
        self._script = find_script(path)
        self._port = port
        self._arguments = tuple(arguments)
        self._graphics_adapter = graphics_adapter
        self._log_path = log_path
        self._timeout_s = timeout_s
        self._environment = environment

    @property
    def exit_code(self) -> int | None:
        """Exit status of CARLA itself: script and leash report its signal n as 128 + n."""
        code = super().exit_code
        if code is None or code - _SIGNALLED not in signal.valid_signals():
            return code
        return _SIGNALLED - code

    def start(self) -> Endpoint:
        """Start it and ask for its version, then for its world, until it answers."""
        host = "127.0.0.1"
        ports = allot_ports(self._port, host, self._ports)
        command = [
            *(sys.executable, "-m", "carstage.server.parent_watch"),
            str(self._script.resolve()),
            *self._arguments,
            "-nosound",
            f"-carla-rpc-port={ports.rpc}",
            f"-carla-streaming-port={ports.streaming}",
            f"-carla-secondary-port={ports.secondary}",
        ]
        if self._graphics_adapter is not None:
            command.append(f"-graphicsadapter={self._graphics_adapter}")
        process = ServerProcess(command, log_path=self._log_path, environment=self._environment)
        self._process = process
        try:
            begin_s = time.monotonic()
            version = wait_for_version(host, ports.rpc, self._timeout_s, process.wait_end)
            left_s = self._timeout_s - (time.monotonic() - begin_s)
            wait_for_world(host, ports.rpc, left_s, process.wait_end)
        except ServerError as error:
            ended = self.exit_code
            status = "" if ended is None else f" Its exit status is {ended}."
            message = f"{error.message}{status} Its last words:\n{process.tail(TAIL_LINES)}"
            hint = (
                f"Run {self._script} by itself: it may lack a driver, Vulkan, or a user that is "
                "not root."
            )
            self.stop()
            if ended is None:
                raise ServerError(message, hint) from error
            raise ServerEndedError(message, hint, ended) from error
        except BaseException:
            self.kill()  # it has nothing to give back
            raise
        self._endpoint = Endpoint(host, ports.rpc, ports.traffic_manager, version, process.pid)
        return self._endpoint
