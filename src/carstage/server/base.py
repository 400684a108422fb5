"""The seam: a server that can be started, asked whether it lives, and stopped."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from types import TracebackType
from typing import ClassVar

from carstage.errors import ServerError
from carstage.plan import ServerFacts
from carstage.server.asking import ask_server
from carstage.server.probe import probe_version

TAIL_LINES = 20


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Where a ready server is.

    Attributes:
        host: its address.
        port: its RPC port.
        traffic_manager_port: a port of this machine that the client's Traffic Manager may take.
        version: the CARLA version that it reports, or whose numbers its data use.
        pid: its process id, which is its process group's; None when we did not start it.
    """

    host: str
    port: int
    traffic_manager_port: int
    version: str
    pid: int | None


class Server(ABC):
    """A server that a run records from; ``with`` starts it and stops it on every way out.

    :meth:`start` returns only when the server answers. :meth:`stop` may be called at any time, any
    number of times, also when starting failed. What :meth:`probe` and :meth:`facts` do here, and
    the collector named here, speak CARLA's protocol. A server that does not has its own.

    Attributes:
        kind: its name in events and messages.
        collector: the module that records from it, run as a process: it takes the collector's plan,
            prints its events (docs/formats/run-folder.md) and writes a raw log
            (docs/formats/raw-log.md).
    """

    kind: ClassVar[str]
    collector: ClassVar[str] = "carstage.collector"

    def __init__(self) -> None:
        self._endpoint: Endpoint | None = None

    @abstractmethod
    def start(self) -> Endpoint:
        """Start it and wait until it answers.

        Raises:
            BadInputError: the address, the path or the port cannot be; nothing runs.
            ServerError: it ended or did not answer in time; it is stopped again.
        """

    @abstractmethod
    def stop(self) -> None:
        """Stop what :meth:`start` started, by its own process group."""

    def kill(self) -> None:
        """Stop it without asking first: it has hung, and would only let us wait."""
        self.stop()

    @abstractmethod
    def alive(self) -> bool:
        """Whether it still runs, as far as this process can see."""

    def probe(self) -> str:
        """Ask it for its version: a run does so every few seconds, from a thread of its own.

        Raises:
            ServerError: it does not answer.
        """
        return probe_version(self.endpoint.host, self.endpoint.port)

    def facts(self) -> ServerFacts:
        """What it offers, asked once it is started: maps, blueprints, whose numbers it uses.

        Raises:
            ServerError: it does not answer.
        """
        endpoint = self.endpoint
        return ask_server(endpoint.host, endpoint.port, endpoint.version)

    @abstractmethod
    def log_tail(self, lines: int = TAIL_LINES) -> str:
        """The last lines that it wrote; empty when there is no log of it here."""

    @property
    def exit_code(self) -> int | None:
        """Exit status of its process once it ended, negative for a signal; else None."""
        return None

    @property
    def endpoint(self) -> Endpoint:
        """Where it is.

        Raises:
            ServerError: it is not started.
        """
        if self._endpoint is None:
            raise ServerError(f"The {self.kind} server is not started.", "Start it first.")
        return self._endpoint

    def __enter__(self) -> Server:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()
