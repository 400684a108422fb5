"""Looks after server and collector while an attempt is recorded: alive, answering, not too large.

The collector sees a server that refuses or is slow; here is seen what it cannot see: a server that
hangs as a whole, so that every one of the collector's calls waits for its timeout, and memory.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import TracebackType

import psutil

from carstage.config.supervision import Supervision
from carstage.errors import CarStageError, CollectorError, ServerError
from carstage.server import Endpoint

_LOOK_EVERY_S = 2.0
_ASK_EVERY_S = 4.0
_LEAST_SILENCES = 3
"""Questions without an answer before a server counts as hung, however short its patience."""
_BUSY_SHARE = 0.02
"""Of a core: a silent server that takes more computes, if slowly; that is no hang yet."""
_BUSY_PATIENCE = 10.0
"""How many times as long it may do so: a deadlocked renderer takes some of a core for ever."""

_MB = 1_000_000
_SERVER_SHARE = 0.75
_COLLECTOR_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class Limits:
    """From when on something is wrong.

    Attributes:
        hang_s: silence after which a server has hung; ten times as long for one that computes.
        server_bytes: most resident memory of the server's processes.
        collector_bytes: most resident memory of the collector.
    """

    hang_s: float
    server_bytes: int
    collector_bytes: int

    @classmethod
    def of(cls, supervision: Supervision) -> Limits:
        """The limits of a configuration on this machine."""
        machine_bytes = psutil.virtual_memory().total
        server, collector = supervision.server_memory, supervision.collector_memory
        return cls(
            supervision.hang_s,
            int(machine_bytes * _SERVER_SHARE) if server == "auto" else server * _MB,
            int(machine_bytes * _COLLECTOR_SHARE) if collector == "auto" else collector * _MB,
        )


class AttemptWatch:
    """A thread that looks at one attempt's processes; a context manager.

    Args:
        endpoint: where the server is.
        collector_pid: process id of the collector.
        limits: from when on something is wrong.
        ask: asks the server for its version; raises ``ServerError`` when it does not answer.
        cpu_s: CPU seconds that a process and its descendants have taken.
        look_every_s: pause between two looks.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        collector_pid: int,
        limits: Limits,
        *,
        ask: Callable[[], str],
        clock_s: Callable[[], float] = time.monotonic,
        cpu_s: Callable[[int], float] | None = None,
        look_every_s: float = _LOOK_EVERY_S,
    ) -> None:
        self._endpoint = endpoint
        self._collector_pid = collector_pid
        self._limits = limits
        self._ask = ask
        self._clock_s = clock_s
        self._cpu_s = cpu_s or taken_cpu_s
        self._look_every_s = look_every_s
        self._answered_s = self._asked_s = self._computed_s = clock_s()
        self._server_cpu_s = 0.0
        self._silences = 0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="attempt-watch", daemon=True)
        self.problem: CarStageError | None = None
        """What is wrong, once something is; the attempt is lost then."""

    def __enter__(self) -> AttemptWatch:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._over.set()
        self._thread.join()

    def look(self) -> None:
        """Look once."""
        self.problem = self._memory_problem() or self._silence_problem()

    def _watch(self) -> None:
        while self.problem is None and not self._over.wait(self._look_every_s):
            self.look()

    def _memory_problem(self) -> CarStageError | None:
        if self._endpoint.pid is not None:
            used = resident_bytes(self._endpoint.pid)
            if used > self._limits.server_bytes:
                return ServerError(
                    f"The server holds {used / _MB:.0f} MB of memory; "
                    f"{self._limits.server_bytes / _MB:.0f} MB are its limit.",
                    "Raise supervision.server_memory, record less at once, or have the server "
                    "started anew more often by server.restart_every.",
                )
        used = resident_bytes(self._collector_pid)
        if used > self._limits.collector_bytes:
            return CollectorError(
                f"The collector holds {used / _MB:.0f} MB of memory; "
                f"{self._limits.collector_bytes / _MB:.0f} MB are its limit.",
                "Raise supervision.collector_memory, or record fewer or smaller sensors.",
            )
        return None

    def _silence_problem(self) -> CarStageError | None:
        now_s = self._clock_s()
        passed_s = now_s - self._asked_s
        if passed_s < min(_ASK_EVERY_S, self._limits.hang_s / _LEAST_SILENCES):
            return None
        self._asked_s = now_s
        if self._computes(passed_s):
            self._computed_s = now_s
        try:
            self._ask()
        except ServerError as error:
            self._silences += 1
            now_s = self._clock_s()
            silent_s = now_s - self._answered_s
            still_s = now_s - max(self._answered_s, self._computed_s)
            hangs = still_s >= self._limits.hang_s
            hangs |= silent_s >= self._limits.hang_s * _BUSY_PATIENCE
            if self._silences < _LEAST_SILENCES or not hangs:
                return None
            return ServerError(
                f"The server has not answered for {silent_s:.0f} s: {error.message}",
                "A server that is only slow needs a longer supervision.hang_s.",
            )
        except Exception as error:  # noqa: BLE001 - a user's code; this thread must go on to tell it
            return ServerError(
                f"The server's probe raised {type(error).__name__}: {error}.",
                "Where a server does not answer, its probe raises a ServerError.",
            )
        self._silences = 0
        self._answered_s = self._clock_s()
        return None

    def _computes(self, passed_s: float) -> bool:
        """Whether the server has computed since the last question; unknown counts as no."""
        if self._endpoint.pid is None:
            return False
        before_s, self._server_cpu_s = self._server_cpu_s, self._cpu_s(self._endpoint.pid)
        return self._server_cpu_s - before_s > _BUSY_SHARE * passed_s


def taken_cpu_s(pid: int) -> float:
    """CPU seconds that a process and all its descendants have taken; 0 for one that is gone."""
    return sum(map(_own_cpu_s, _family(pid)))


def resident_bytes(pid: int) -> int:
    """Resident memory of a process and all its descendants; 0 for one that is gone."""
    return sum(map(_own_resident_bytes, _family(pid)))


def _family(pid: int) -> Iterable[psutil.Process]:
    try:
        root = psutil.Process(pid)
        return [root, *root.children(recursive=True)]
    except psutil.Error:
        return []


def _own_cpu_s(process: psutil.Process) -> float:
    try:
        times = process.cpu_times()
    except psutil.Error:
        return 0.0
    return float(times.user + times.system)


def _own_resident_bytes(process: psutil.Process) -> int:
    try:
        return int(process.memory_info().rss)
    except psutil.Error:
        return 0
