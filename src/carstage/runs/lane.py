"""A lane: one server, and a collector on it for each attempt.

Each attempt has a collector process of its own, so that nothing of one episode (client, Traffic
Manager, sensors) can leak into the next, and a crash costs one attempt.
"""

from __future__ import annotations

import os
import selectors
import signal
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack
from functools import partial
from types import TracebackType
from typing import Any, Protocol

from carstage.errors import CarStageError, CollectorError, ServerError
from carstage.execution import CollectorProcess
from carstage.plan import estimate_tick_s
from carstage.runs.folder import RunFolder
from carstage.runs.interruption import Interruption
from carstage.runs.landing import Job, Landing
from carstage.runs.servers import ServerSetup
from carstage.server import Endpoint, Server

POLL_S = 0.2
_STALL_S = 600.0
_STOP_S = 20.0
_LAST_WORDS_S = 3.0
_CALL_TIMEOUT_S = 20.0
_CALL_TIMEOUT_TICKS = 30
_QUEUE_BYTES = 256 * 1024 * 1024
#: The collector's errors that another attempt would only repeat.
_FINAL_KINDS = frozenset({"plan", "scene", "version"})


class LaneHost(Protocol):
    """What a lane needs of its run."""

    def begin(self, job: Job) -> Landing:
        """Reserve an attempt."""

    def heard(self, event: Mapping[str, Any]) -> None:
        """An event of the collector or the server."""

    def poll(self) -> None:
        """Do what is due: heartbeat, conversions that are complete."""

    def waiting(self, what: str) -> AbstractContextManager[None]:
        """A stretch without ``poll``; the heartbeat goes on, and a long one is explained."""

    def recorded(self, landing: Landing) -> None:
        """An attempt is recorded completely."""

    def attempt_failed(self, landing: Landing, error: CarStageError, *, final: bool) -> None:
        """An attempt failed; ``final``: another one would, too."""


class _FinalCollectorError(CollectorError):
    """The collector refused the episode; another attempt would end alike."""


class ServerLane:
    """One server with its collector; a context manager that stops both.

    Args:
        setup: how the server is started.
        host: the run.
        folder: folder of the run.
        interruption: the run's signals.
        python: interpreter of the collector.
    """

    def __init__(
        self,
        setup: ServerSetup,
        host: LaneHost,
        folder: RunFolder,
        interruption: Interruption,
        *,
        python: str = sys.executable,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._setup = setup
        self._host = host
        self._folder = folder
        self._interruption = interruption
        self._python = python
        self._clock_s = clock_s
        self._server: Server | None = None
        self._endpoint: Endpoint | None = None

    def __enter__(self) -> ServerLane:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stop_server()

    def record(self, job: Job) -> None:
        """Record one attempt and tell the run how it went.

        Raises:
            ServerError: the server cannot be started.
            KeyboardInterrupt: the user ended the run; the attempt is the run's to remove.
        """
        endpoint = self._running_endpoint()
        with self._interruption.held():
            landing = self._host.begin(job)
        try:
            self._record(landing, endpoint)
        except CarStageError as error:
            with self._interruption.held():
                landing.give_up()
                self._host.attempt_failed(
                    landing, error, final=isinstance(error, _FinalCollectorError)
                )
        else:
            self._host.recorded(landing)

    def _running_endpoint(self) -> Endpoint:
        if self._server is not None and not self._server.alive():
            self._stop_server()
        if self._server is None or self._endpoint is None:
            self._interruption.check()
            with self._host.waiting("The server is starting; its first start compiles a while."):
                server, endpoint = self._setup.start(self._folder.logs / "server.log")
            self._server, self._endpoint = server, endpoint
            self._host.heard(
                {
                    "event": "server_started",
                    "kind": server.kind,
                    "host": endpoint.host,
                    "port": endpoint.port,
                    "pid": endpoint.pid,
                }
            )
        return self._endpoint

    def _stop_server(self) -> None:
        server, self._server, self._endpoint = self._server, None, None
        if server is not None:
            with self._interruption.held():
                server.stop()
                self._host.heard({"event": "server_stopped", "exit_code": server.exit_code})

    def _record(self, landing: Landing, endpoint: Endpoint) -> None:
        name = f"{landing.job.episode_id}-{landing.attempt}"
        collector = CollectorProcess(
            self._plan(landing, endpoint),
            plan_path=self._folder.logs / f"collector-plan-{name}.json",
            log_path=self._folder.logs / "collector.log",
            python=self._python,
        )
        last_words: dict[str, Any] = {}
        complete = False
        with ExitStack() as stack:
            stack.enter_context(self._interruption.held())
            stack.enter_context(collector)
            stack.enter_context(self._interruption.kills(collector.kill))
            if endpoint.pid is not None:
                kill_server = partial(os.killpg, endpoint.pid, signal.SIGKILL)
                stack.enter_context(self._interruption.kills(kill_server))
            for event in self._listen(collector):
                if event["event"] == "segment_sealed":
                    landing.segment_sealed(str(event["stream"]), int(event["segment"]))
                elif event["event"] == "episode_recorded":
                    complete = True
                elif event["event"] == "error":
                    last_words = dict(event)
                self._host.heard(event)
            if not collector.ended:
                collector.kill()
            code = collector.wait(_STOP_S)
        self._interruption.check()
        if code != 0 or not complete:
            raise self._explain(landing, code, last_words, collector)

    def _own_server_ended(self) -> bool:
        server = self._server
        return server is not None and server.endpoint.pid is not None and not server.alive()

    def _plan(self, landing: Landing, endpoint: Endpoint) -> dict[str, Any]:
        spec = landing.job.spec
        return {
            "plan_version": 1,
            "server": {
                "host": endpoint.host,
                "port": endpoint.port,
                "timeout_s": _CALL_TIMEOUT_S + _CALL_TIMEOUT_TICKS * estimate_tick_s(spec),
                "traffic_manager_port": endpoint.traffic_manager_port,
            },
            "queue_bytes": _QUEUE_BYTES,
            "sensor_warmup_ticks": self._setup.sensor_warmup_ticks,
            "episodes": [
                {
                    "episode_id": landing.job.episode_id,
                    "attempt": landing.attempt,
                    "folder": str(landing.raw_folder.absolute()),
                    "spec": spec.to_json(),
                }
            ],
        }

    def _listen(self, collector: CollectorProcess) -> Any:
        """The collector's events until it closes its stream; looks after the run meanwhile."""
        deadline_s = self._clock_s() + _STALL_S
        stopping = server_gone = False
        with selectors.DefaultSelector() as selector:
            selector.register(collector, selectors.EVENT_READ)
            selector.register(self._interruption, selectors.EVENT_READ)
            while not collector.ended:
                ready = {key.fileobj for key, _ in selector.select(POLL_S)}
                if collector in ready:
                    yield from collector.read_events()
                    if not stopping and not server_gone:
                        deadline_s = self._clock_s() + _STALL_S
                if self._interruption.requested and not stopping:
                    selector.unregister(self._interruption)
                    stopping = True
                    deadline_s = self._clock_s() + _STOP_S
                    collector.stop()
                if not stopping and not server_gone and self._own_server_ended():
                    # The collector would wait for the answer to its last call for a long time.
                    server_gone = True
                    deadline_s = self._clock_s() + _LAST_WORDS_S
                if self._clock_s() > deadline_s:
                    if stopping or server_gone:
                        return
                    raise CollectorError(
                        f"The collector gave no sign for {_STALL_S:.0f} s.",
                        f"See the logs in {self._folder.logs}.",
                    )
                if not stopping:
                    self._host.poll()

    def _explain(
        self,
        landing: Landing,
        code: int | None,
        last_words: Mapping[str, Any],
        collector: CollectorProcess,
    ) -> CarStageError:
        """Why an attempt ended early: the server, a signal, the collector's own error."""
        where = f"episode {landing.job.episode_id}, attempt {landing.attempt}"
        if self._server is not None and not self._server.alive():
            return ServerError(
                f"The server ended while {where} was recorded.",
                _with_tail(f"See {self._folder.logs / 'server.log'}.", self._server.log_tail()),
            )
        if code is not None and code < 0:
            return CollectorError(
                f"The collector was ended by {signal.Signals(-code).name} in {where}.",
                _with_tail("The server is still up.", collector.log_tail()),
            )
        if last_words:
            kind = (
                _FinalCollectorError if last_words.get("kind") in _FINAL_KINDS else CollectorError
            )
            return kind(f"{last_words.get('message')} ({where})", str(last_words.get("hint") or ""))
        return CollectorError(
            f"The collector ended with exit code {code} in {where}.",
            _with_tail(f"See {self._folder.logs / 'collector.log'}.", collector.log_tail()),
        )


def _with_tail(hint: str, tail: str) -> str:
    lines = tail.splitlines()[-12:]
    return "\n".join([f"{hint} Its log ends:", *lines]) if lines else hint
