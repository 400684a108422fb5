"""A CARLA server that somebody else started; it is asked, never ended."""

from __future__ import annotations

import threading
from typing import ClassVar

from carstage.errors import ServerError
from carstage.server.base import TAIL_LINES, Endpoint, Server
from carstage.server.ports import free_port
from carstage.server.probe import probe_version, wait_for_version

ANSWER_S = 20.0
RETURN_S = 120.0
"""How long to wait for one that answered before: somebody may be starting it again."""


class RemoteServer(Server):
    """A server at a known address.

    Args:
        host: its address.
        port: its RPC port.
        timeout_s: how long to wait for its answer, the first time.
        return_s: how long to wait for it when it answered before.
    """

    kind: ClassVar[str] = "remote"

    def __init__(
        self,
        host: str,
        port: int,
        *,
        timeout_s: float = ANSWER_S,
        return_s: float = RETURN_S,
    ) -> None:
        super().__init__()
        self._host = host
        self._port = port
        self._timeout_s = timeout_s
        self._return_s = return_s

    def start(self) -> Endpoint:
        """Ask for its version until it answers."""
        never = threading.Event()
        try:
            version = wait_for_version(self._host, self._port, self._timeout_s, never.wait)
        except ServerError as error:
            raise ServerError(
                error.message, "Check server.host and server.port, and that the server runs."
            ) from error
        self._timeout_s = self._return_s
        self._endpoint = Endpoint(self._host, self._port, free_port(), version, None)
        return self._endpoint

    def stop(self) -> None:
        """Leave it alone."""
        self._endpoint = None

    def alive(self) -> bool:
        """Whether it answers now."""
        try:
            probe_version(self._host, self._port)
        except ServerError:
            return False
        return True

    def log_tail(self, lines: int = TAIL_LINES) -> str:
        """Nothing: its log is elsewhere."""
        return ""
