"""A worker: one server, and a collector on it for each attempt.

Each attempt has a collector process of its own, so that nothing of one episode (client, Traffic
Manager, sensors) can leak into the next, and a crash costs one attempt. After an attempt that broke
off, the server is replaced: what it still holds, and whether it is sound, nobody knows.
"""

from __future__ import annotations

import os
import selectors
import signal
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack, suppress
from functools import partial
from types import TracebackType
from typing import Any, Protocol

from carstage.errors import (
    CarStageError,
    CollectorError,
    ConversionError,
    ServerEndedError,
    StorageError,
)
from carstage.execution import CollectorAhead, CollectorProcess, InterpreterError
from carstage.plan import estimate_tick_s
from carstage.runs.attempt_commit import AttemptCommit, Job
from carstage.runs.explaining import (
    FinalCollectorError,
    LostServerError,
    explain_end,
    explain_loss,
)
from carstage.runs.folder import INPUTS_FILE, RunFolder
from carstage.runs.interruption import GIVE_BACK_S, Interruption
from carstage.runs.servers import ServerSetup
from carstage.runs.watching import AttemptWatch, Limits
from carstage.sensor_kinds import plugins_of
from carstage.server import Endpoint, Server
from carstage.spec import EpisodeSpec
from carstage.storage.disk import disk_error

COLLECTOR_LOG = "collector.log"
POLL_S = 0.2
_STALL_S = 600.0
_STOP_S = 20.0
_LAST_WORDS_S = 3.0
_CALL_TIMEOUT_TICKS = 30
_LOAD_PATIENCE = 10.0
"""How many times as long as another call the loading of a map may take."""
_BYTES_PER_MB = 1_000_000
_START_TRIES = 2


class WorkerHost(Protocol):
    """What a worker needs of its run."""

    def begin(self, job: Job) -> AttemptCommit:
        """Reserve an attempt."""

    def on_event(self, event: Mapping[str, Any]) -> None:
        """An event of the collector or the server."""

    def poll(self) -> None:
        """Do what is due: heartbeat, conversions that are complete."""

    def waiting(self, what: str) -> AbstractContextManager[None]:
        """A stretch without ``poll``; the heartbeat goes on, and a long one is explained."""

    def start_failed(self, job: Job, error: CarStageError) -> bool:
        """The server was killed while it started; returns whether the job will come again."""

    def recorded(self, attempt_commit: AttemptCommit, incomplete_ticks: int) -> bool:
        """An attempt is recorded to its end; returns whether it may land."""

    def attempt_failed(
        self, attempt_commit: AttemptCommit, error: CarStageError, *, final: bool
    ) -> None:
        """An attempt failed; ``final``: another one would, too."""


#: Errors that are not the server's fault.
_LEAVE_THE_SERVER = (FinalCollectorError, InterpreterError, ConversionError, StorageError)
#: Errors that another attempt would meet again.
_FINAL = (FinalCollectorError, InterpreterError)


class ServerWorker:
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
        host: WorkerHost,
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
        self._ahead: CollectorAhead | None = None
        self._recorded_on_server = 0

    def __enter__(self) -> ServerWorker:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._end_ahead()
        self._stop_server()

    def record(self, job: Job) -> None:
        """Record one attempt and tell the run how it went.

        Raises:
            ServerError: the server cannot be started.
            KeyboardInterrupt: the user ended the run; the attempt is the run's to remove.
        """
        try:
            endpoint = self._running_endpoint()
        except ServerEndedError as killed:
            if killed.was_killed and self._host.start_failed(job, killed):
                return
            raise
        with self._interruption.deferred():
            attempt_commit = self._host.begin(job)
        try:
            incomplete_ticks = self._record(attempt_commit, endpoint)
        except (CarStageError, OSError) as problem:
            error = problem if isinstance(problem, CarStageError) else self._disk_error(problem)
            with self._interruption.deferred():
                attempt_commit.give_up()
                if not isinstance(error, _LEAVE_THE_SERVER):
                    self._stop_server(at_once=isinstance(error, LostServerError))
                self._host.attempt_failed(attempt_commit, error, final=isinstance(error, _FINAL))
        else:
            self._recorded_on_server += 1
            with self._interruption.deferred():
                if not self._host.recorded(attempt_commit, incomplete_ticks):
                    self._stop_server()

    def _disk_error(self, error: OSError) -> StorageError:
        return disk_error(error, f"in {self._folder.path}")

    def _running_endpoint(self) -> Endpoint:
        """Where the server is; it is started, or replaced when it ended or its time is over."""
        if self._server is not None:
            worn_out = 0 < self._setup.restart_every <= self._recorded_on_server
            if worn_out or not self._server.alive():
                self._stop_server()
        if self._server is None or self._endpoint is None:
            server, endpoint = self._start_server()
            self._server, self._endpoint = server, endpoint
            self._recorded_on_server = 0
            self._host.on_event(
                {
                    "event": "server_started",
                    "kind": server.kind,
                    "host": endpoint.host,
                    "port": endpoint.port,
                    "pid": endpoint.pid,
                }
            )
        return self._endpoint

    def _start_server(self) -> tuple[Server, Endpoint]:
        """Start it; once more when it ended by itself, as large servers now and then do."""
        tries_left = _START_TRIES
        self._start_ahead()
        while True:
            self._interruption.check()
            tries_left -= 1
            try:
                with self._host.waiting(self._setup.start_notice):
                    return self._setup.start(self._folder.logs / "server.log")
            except ServerEndedError as error:
                if not tries_left:
                    raise
                self._host.on_event({"event": "server_lost", "reason": str(error)})
            except OSError as error:
                raise self._disk_error(error) from error

    def _start_ahead(self) -> None:
        """Have a collector load its client while the server starts."""
        if self._ahead is None and self._setup.has_own_collector:
            with suppress(OSError):  # the one that is started later tells it
                self._ahead = CollectorAhead(self._folder.logs / COLLECTOR_LOG, self._python)

    def _end_ahead(self) -> None:
        ahead, self._ahead = self._ahead, None
        if ahead is not None:
            ahead.end()

    def _stop_server(self, *, at_once: bool = False) -> None:
        server, self._server, self._endpoint = self._server, None, None
        if server is not None:
            with self._interruption.deferred():
                if at_once or self._interruption.requested:
                    server.kill()
                else:
                    server.stop()
                self._host.on_event({"event": "server_stopped", "exit_code": server.exit_code})

    def _record(self, attempt_commit: AttemptCommit, endpoint: Endpoint) -> int:
        """Record the attempt; returns the number of its incomplete ticks."""
        server = self._server
        assert server is not None
        name = f"{attempt_commit.job.episode_id}-{attempt_commit.attempt}"
        collector = CollectorProcess(
            self._plan(attempt_commit, endpoint),
            plan_path=self._folder.logs / f"collector-plan-{name}.json",
            log_path=self._folder.logs / COLLECTOR_LOG,
            python=self._python,
            module=server.collector,
            folders=self._setup.collector_folders,
            ahead=self._ahead,
        )
        last_words: dict[str, Any] = {}
        incomplete_ticks: int | None = None
        with ExitStack() as stack:
            stack.enter_context(self._interruption.deferred())
            stack.enter_context(collector)
            self._ahead = None
            stack.enter_context(self._interruption.kills(collector.kill))
            if endpoint.pid is not None:
                kill_server = partial(os.killpg, endpoint.pid, signal.SIGKILL)
                stack.enter_context(self._interruption.kills(kill_server))
            watch = stack.enter_context(self._watch(server, endpoint, collector))
            call_s, load_s = self._timeouts_s(attempt_commit.job.spec)
            # The longest stretch without an event: the map is loaded, with other calls around it.
            stall_s = max(_STALL_S, load_s + 2 * call_s)
            for event in self._listen(collector, watch, stall_s):
                if event["event"] == "segment_sealed":
                    attempt_commit.segment_sealed(str(event["stream"]), int(event["segment"]))
                elif event["event"] == "episode_recorded":
                    incomplete_ticks = int(event["incomplete"])
                elif event["event"] == "error":
                    last_words = dict(event)
                self._host.on_event(event)
            if not collector.ended:
                collector.kill()
            code = collector.wait(_STOP_S)
        if self._interruption.requested:
            if incomplete_ticks is not None:
                return incomplete_ticks  # it came to its end; what came after does not count
            raise KeyboardInterrupt
        if watch.problem is not None:
            raise explain_loss(attempt_commit, watch.problem, self._server, collector)
        if code != 0 or incomplete_ticks is None:
            raise explain_end(
                attempt_commit, self._folder.logs, self._server, collector, code, last_words
            )
        return incomplete_ticks

    def _watch(
        self, server: Server, endpoint: Endpoint, collector: CollectorProcess
    ) -> AttemptWatch:
        limits = Limits.of(self._setup.supervision)
        return AttemptWatch(endpoint, collector.pid, limits, ask=server.probe)

    def _owns_server(self) -> bool:
        return self._server is not None and self._server.endpoint.pid is not None

    def _own_server_ended(self) -> bool:
        return self._owns_server() and self._server is not None and not self._server.alive()

    def _timeouts_s(self, spec: EpisodeSpec) -> tuple[float, float]:
        """How long one of the collector's calls, and loading a map, may take."""
        hang_s = self._setup.supervision.hang_s
        return hang_s + _CALL_TIMEOUT_TICKS * estimate_tick_s(spec), _LOAD_PATIENCE * hang_s

    def _plan(self, attempt_commit: AttemptCommit, endpoint: Endpoint) -> dict[str, Any]:
        spec = attempt_commit.job.spec
        call_s, load_s = self._timeouts_s(spec)
        gnss = attempt_commit.gnss
        return {
            "plan_version": 1,
            "plugins": _plugins(spec),
            "driver_folders": self._setup.driver_folders,
            "inputs_file": str((self._folder.path / INPUTS_FILE).absolute()),
            **self._setup.program,
            "server": {
                "host": endpoint.host,
                "port": endpoint.port,
                "timeout_s": call_s,
                "load_timeout_s": load_s,
                "traffic_manager_port": endpoint.traffic_manager_port,
                "exact_sensor_tick": self._setup.exact_sensor_tick,
                **({} if gnss is None else {"gnss": dict(gnss)}),
            },
            "queue_bytes": self._setup.output.raw_queue_mb * _BYTES_PER_MB,
            "raw_store": self._setup.output.raw_store,
            "durable": self._setup.raw_must_last,
            "sensor_warmup_ticks": self._setup.sensor_warmup_ticks,
            "episodes": [
                {
                    "episode_id": attempt_commit.job.episode_id,
                    "attempt": attempt_commit.attempt,
                    "folder": str(attempt_commit.raw_folder.absolute()),
                    "spec": spec.to_json(),
                }
            ],
        }

    def _listen(self, collector: CollectorProcess, watch: AttemptWatch, stall_s: float) -> Any:
        """The collector's events until it closes its stream; looks after the run meanwhile.

        Raises:
            CollectorError: it gave no event for ``stall_s``, or one that is none.
        """
        deadline_s = self._clock_s() + stall_s
        stopping = server_gone = False
        with selectors.DefaultSelector() as selector:
            selector.register(collector, selectors.EVENT_READ)
            selector.register(self._interruption, selectors.EVENT_READ)
            while not collector.ended:
                ready = {key.fileobj for key, _ in selector.select(POLL_S)}
                if collector in ready:
                    yield from collector.read_events()
                    if not stopping and not server_gone:
                        deadline_s = self._clock_s() + stall_s
                if self._interruption.requested and not stopping:
                    selector.unregister(self._interruption)
                    yield from collector.read_events()  # it may have come to the end by now
                    if self._owns_server():  # then there is nothing to give back
                        collector.kill()
                        self._stop_server()
                        return
                    stopping = True
                    deadline_s = self._clock_s() + GIVE_BACK_S
                    collector.stop()
                if not stopping and not server_gone and self._own_server_ended():
                    # The collector would wait for the answer to its last call for a long time.
                    server_gone = True
                    deadline_s = self._clock_s() + _LAST_WORDS_S
                if watch.problem is not None and not stopping:
                    return
                if self._clock_s() > deadline_s:
                    if stopping or server_gone:
                        return
                    raise CollectorError(
                        f"The collector gave no sign for {stall_s:.0f} s.",
                        f"See the logs in {self._folder.logs}.",
                    )
                if not stopping:
                    self._host.poll()


def _plugins(spec: EpisodeSpec) -> list[str]:
    """Modules that the collector imports so that it knows the episode's sensors and events."""
    of_sensors = plugins_of(sensor.kind for sensor in spec.streams.values())
    if not spec.scenario.events:
        return list(of_sensors)
    from carstage.spec.events import event_plugins  # few episodes have any

    return [*of_sensors, *event_plugins(spec.scenario.events)]
