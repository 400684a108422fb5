"""The server that pictures come from: the embedded simulator, or one of the configuration's."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from carstage.web.errors import WebError

if TYPE_CHECKING:
    from carstage.config import Config
    from carstage.plan import ServerFacts
    from carstage.runs.servers import ServerSetup
    from carstage.server import EmbeddedServer, Endpoint

EMBEDDED_IDLE_S = 240.0
OTHER_IDLE_S = 40.0
"""A server that others wait for, or that takes a graphics card, is given back sooner."""


class PictureServer:
    """One server, started and given back as a whole, with what it offers.

    The embedded simulator is one of its own, and disturbs nobody. A release is started. A server at
    an address is borrowed: with the same lock as runs have, so that none begins meanwhile.

    Args:
        config: a configuration with its section ``server``.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._given = ExitStack()
        self._embedded: EmbeddedServer | None = None
        self._setup: ServerSetup | None = None
        self.facts: ServerFacts | None = None

    @property
    def embedded(self) -> bool:
        """Whether it is a simulator of its own, beside those of runs."""
        return self._config.server.kind == "embedded"

    @property
    def shared(self) -> bool:
        """Whether others may use it at the same time."""
        return self._config.server.kind == "remote"

    @property
    def idle_s(self) -> float:
        """How long it is kept when nobody asks."""
        return EMBEDDED_IDLE_S if self.embedded else OTHER_IDLE_S

    @property
    def key(self) -> str | None:
        """Which runs need the same server; None: none does."""
        from carstage.runs.server_lock import server_key

        return None if self.embedded else server_key(self._config)

    @property
    def python(self) -> str:
        """The interpreter with the client wheel for it."""
        return sys.executable if self._setup is None else str(self._setup.client.path)

    @property
    def endpoint(self) -> Endpoint:
        """Where it is, once it is started."""
        if self._embedded is not None:
            return self._embedded.endpoint
        assert self._setup is not None
        return self._setup.warm_up(None)

    def fits(self, config: Config) -> bool:
        """Whether it is the server of a configuration; all embedded ones are the same."""
        other = config.server
        return other == self._config.server or (self.embedded and other.kind == "embedded")

    def start(self) -> None:
        """Start it, or connect to it; returns when it answers and what it offers is known.

        Raises:
            CarStageError: it does not answer, there is no client for it, or a run has it.
        """
        if self.embedded:
            from carstage.server import EmbeddedServer

            self._embedded = EmbeddedServer(arguments=("--quality", "low"))
            self._embedded.start()
            return
        from carstage.runs.server_lock import server_lock
        from carstage.runs.servers import ServerSetup

        try:
            self._given.enter_context(server_lock(self._config))
            self._setup = ServerSetup(self._config)
            self.facts = self._given.enter_context(self._setup.facts())
        except BaseException:
            self._given.close()
            raise

    def alive(self) -> bool:
        """Whether it still runs, as far as this process can see."""
        if self._embedded is not None:
            return self._embedded.alive()
        return self._setup is not None and not self._setup.has_ended

    def stop(self) -> None:
        """Stop what was started; one at an address is left alone."""
        if self._embedded is not None:
            self._embedded.stop()
        self._given.close()

    def kill(self) -> None:
        """End a start that may last minutes, from another thread."""
        if self._embedded is not None:
            self._embedded.kill()
        if self._setup is not None:
            self._setup.cool_down()

    def plan(self) -> dict[str, Any]:
        """The section ``server`` of a collector's plan."""
        endpoint = self.endpoint
        return {
            "host": endpoint.host,
            "port": endpoint.port,
            "traffic_manager_port": endpoint.traffic_manager_port,
            **({"shared": True} if self.shared else {}),
        }


def refuse_used(used: bool) -> None:
    """Leave a server to a run.

    Raises:
        WebError: a run uses it.
    """
    if used:
        raise WebError(
            409,
            "A run uses this server, or waits for it.",
            "Look through the sensor when the run has ended.",
        )
