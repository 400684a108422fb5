"""Misbehaving connections next to a healthy client, and what became of it and of the server."""

from __future__ import annotations

import random
import statistics
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

from benchmarks.process_figures import open_files, rss_mb
from benchmarks.simulator.client_process import TrialError, run_trial
from benchmarks.simulator.fuzz.healthy import HealthyFigures, healthy_trial, newcomer_trial
from benchmarks.simulator.fuzz.misbehaving_clients import ALL, MisbehavingClient, UnansweredError
from benchmarks.simulator.fuzz.requests import Requests
from benchmarks.simulator.server_process import RunningServer, started_server
from carstage.bench.verdict import Figure, Verdict

LONGEST_TICK_S = 1.0
MOST_GROWTH_MB = 300.0
FEWEST_TICKS = 10
"""Of the healthy client while others misbehave; fewer would show little."""
_OVERLAP = 6
_LOG_TAIL = 60
_TOLD_SLOW = 8
_BEFORE_S = 1.0
_CLOSED_WITHIN_S = 20.0


class _HealthyClient:
    """Runs the healthy client beside a block; `figures` are there when the block is left."""

    def __init__(self, port: int) -> None:
        self.figures = HealthyFigures()
        self._port = port
        self._everything = ExitStack()

    @property
    def has_ticked_enough(self) -> bool:
        """Whether it noticed what there was to notice, or has ended early."""
        return self._enough.exists() or self._trial.done()

    def __enter__(self) -> _HealthyClient:
        with ExitStack() as opened:
            folder = opened.enter_context(tempfile.TemporaryDirectory(prefix="carstage-fuzz-"))
            ready, self._enough, self._end = (
                Path(folder) / name for name in ("ready", "enough", "end")
            )
            self._trial = opened.enter_context(ThreadPoolExecutor(1)).submit(
                run_trial,
                healthy_trial,
                self._port,
                ready=str(ready),
                enough=str(self._enough),
                fewest=FEWEST_TICKS,
                until=str(self._end),
                timeout_s=3600.0,
            )
            pause = threading.Event()
            while not ready.exists() and not self._trial.done():
                pause.wait(0.05)
            self._everything = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        with self._everything:
            self._end.touch()
            try:
                self.figures = self._trial.result()
            except TrialError as error:
                self.figures = HealthyFigures(wrong=[str(error)])


class _Campaign:
    """Misbehaving connections one after another, several of them open at a time."""

    def __init__(self, server: RunningServer, seed: int, healthy: _HealthyClient) -> None:
        rng = random.Random(seed)
        spawned: list[int] = []
        self.done: Counter[str] = Counter()
        self.unanswered: list[str] = []
        self.calls = 0
        self.spans: list[tuple[float, float, str]] = []
        self.peak_mb = 0.0
        self._server = server
        self._healthy = healthy
        self._rng = rng
        self._spawned = spawned
        self._requests = Requests(rng, spawned)

    def run(self, calls: int | None, until_s: float | None) -> None:
        """Misbehave until so many calls were made, or until a time of the monotonic clock.

        However fast the calls are, misbehaving goes on until the healthy client had time to
        notice.
        """
        names = sorted(ALL)
        open_ones: list[ExitStack] = []
        with ExitStack() as everything:
            while self._server.alive and self._goes_on(calls, until_s):
                # Every way once in each round, in another order each time.
                for name in self._rng.sample(names, len(names)):
                    stack = everything.enter_context(ExitStack())
                    self._one(name, stack)
                    open_ones.append(stack)
                    if len(open_ones) > _OVERLAP:
                        open_ones.pop(self._rng.randrange(len(open_ones))).close()
                    if not self._server.alive or not self._goes_on(calls, until_s):
                        break
                self.peak_mb = max(self.peak_mb, rss_mb(self._server.pid))

    def _goes_on(self, calls: int | None, until_s: float | None) -> bool:
        if self.unanswered:
            return False
        wanted = (
            calls is None
            or self.calls < calls
            or len(self.done) < len(ALL)
            or not self._healthy.has_ticked_enough
        )
        return wanted and (until_s is None or time.monotonic() < until_s)

    def _one(self, name: str, stack: ExitStack) -> None:
        began_s = time.monotonic()
        client = MisbehavingClient(
            self._server.port,
            self._server.streaming_port,
            self._rng,
            self._requests,
            self._spawned,
            stack,
        )
        try:
            ALL[name](client)
        except (UnansweredError, ConnectionError, TimeoutError) as error:
            last = "; ".join(client.last)
            self.unanswered.append(f"{name}: {error!r}; its last calls: {last}")
        self.spans.append((began_s, time.monotonic(), name))
        self.calls += client.calls
        self.done[name] += 1


def check_fuzz(*, seconds: float | None = None, calls: int | None = 2000, seed: int = 7) -> Verdict:
    """Is everybody well after all that?

    Args:
        seconds: how long to misbehave, None for no limit.
        calls: how many whole calls to make, None for no limit.
        seed: of every choice.
    """
    # All cores, as users start it: misbehaving clients have real cameras, which are drawn.
    arguments = ("--map", "Stage01")
    with started_server(arguments) as server, started_server(arguments) as quiet_server:
        until_s = None if seconds is None else time.monotonic() + seconds
        with (
            _HealthyClient(server.port) as healthy_client,
            _HealthyClient(quiet_server.port) as quiet,
        ):
            campaign = _Campaign(server, seed, healthy_client)
            files_before, before_mb = open_files(server.pid), rss_mb(server.pid)
            campaign.run(calls, until_s)
        healthy = healthy_client.figures
        if campaign.unanswered and server.alive:
            server.abort()
        alive = server.alive
        missing = run_trial(newcomer_trial, server.port, timeout_s=300.0) if alive else ["a server"]
        files_left = _files_left(server, files_before) if alive else -1
        growth_mb = rss_mb(server.pid) - before_mb if alive else -1.0
        if not alive:
            missing += [f"exit status {server.exit_code}", *server.log[-_LOG_TAIL:]]
        log = server.log
    tracebacks = [number for number, line in enumerate(log) if line.startswith("Traceback")]
    first_tracebacks = ["\n".join(log[max(at - 1, 0) : at + 30]) for at in tracebacks[:3]]
    return Verdict(
        "fuzz",
        (
            Figure("seed", seed),
            Figure("kinds_of_misbehaviour", len(campaign.done), "==", len(ALL)),
            Figure("misbehaving_connections", sum(campaign.done.values())),
            Figure("calls", campaign.calls),
            Figure("calls_without_an_answer", len(campaign.unanswered), "==", 0),
            Figure("server_alive", str(alive), "==", "True"),
            Figure("unhandled_exceptions_in_the_log", len(tracebacks), "==", 0),
            Figure("lines_in_the_log", len(log)),
            Figure("ticks_of_the_healthy_client", healthy.ticks, ">=", FEWEST_TICKS),
            Figure("faults_it_saw", len(healthy.wrong), "==", 0),
            Figure("missed_by_a_newcomer", len(missing), "==", 0),
            Figure("longest_tick_s", healthy.longest_tick_s, "<=", LONGEST_TICK_S),
            Figure("longest_tick_left_alone_s", quiet.figures.longest_tick_s),
            Figure("ticks_left_alone", quiet.figures.ticks),
            Figure("median_tick_s", statistics.median(healthy.ticks_s or [0.0])),
            Figure("median_tick_left_alone_s", statistics.median(quiet.figures.ticks_s or [0.0])),
            Figure("memory_before_mb", before_mb),
            Figure("memory_peak_mb", campaign.peak_mb),
            Figure("memory_growth_mb", growth_mb, "<=", MOST_GROWTH_MB),
            Figure("connections_left_open", max(files_left, 0), "==", 0),
        ),
        (
            *campaign.unanswered[:5],
            *missing,
            *healthy.wrong[:5],
            *quiet.figures.wrong[:5],
            *first_tracebacks,
            *_slowest(healthy, campaign.spans),
        ),
    )


def _slowest(healthy: HealthyFigures, spans: list[tuple[float, float, str]]) -> list[str]:
    """The slowest ticks of the healthy client, and who misbehaved meanwhile or just before."""
    seen = []
    for ended_s, took_s in sorted(healthy.slow, key=lambda slow: -slow[1])[:_TOLD_SLOW]:
        names = [
            name
            for began, end, name in spans
            if began < ended_s and end > ended_s - took_s - _BEFORE_S
        ]
        seen.append(f"a tick of {took_s:.2f} s beside {', '.join(names) or 'nothing'}")
    return seen


def _files_left(server: RunningServer, before: int) -> int:
    """Descriptors more than before, once the server had time to see that all are gone."""
    deadline, pause = time.monotonic() + _CLOSED_WITHIN_S, threading.Event()
    while (left := open_files(server.pid) - before) > 0 and time.monotonic() < deadline:
        pause.wait(0.1)
    return left
