"""How much faster a tick of the demonstration is when the simulator has more cores.

A client that drops everything makes the ticks of the demonstration, labels' hidden sensors
included. The simulator is held to some cores, with as many threads, the client never: so the ratio
shows what of a tick the simulator spreads over cores. Numbers of cores take turns.
"""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from carstage.bench.episodes import client_plan, events_of, planned_episode_of
from carstage.bench.process_figures import process_cpu_s
from carstage.bench.verdict import Figure, Verdict
from carstage.config import load_demo
from carstage.errors import BadInputError
from carstage.execution import CollectorProcess
from carstage.server import EmbeddedServer, allot_ports
from carstage.spec import EpisodeSpec

_DISCARD = "carstage.bench.clients.discard"
_FEW, _MANY = 2, 16
_LEAST_GAIN = 6.0
"""Of 16 cores over 2."""


@dataclass(frozen=True, slots=True)
class Ticks:
    """What a tick took: wall seconds and CPU seconds of the server."""

    wall_s: float
    server_cpu_s: float


def measure_cores(
    counts: Sequence[int] | None = None,
    *,
    rounds: int = 3,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Tick the demonstration with each number of cores.

    Args:
        counts: numbers of cores; None: two, and all that this process may use, up to 16.
        rounds: recordings with each; their median counts.
        progress: called with the recordings done and their total number.

    Raises:
        BadInputError: a number is not between 1 and the cores that there are.
    """
    cores = sorted(os.sched_getaffinity(0))
    counts = sorted(set(counts or (min(_FEW, len(cores)), min(_MANY, len(cores)))))
    if not 1 <= counts[0] <= counts[-1] <= len(cores):
        raise BadInputError(f"--cores must be between 1 and {len(cores)}.", "Ask for fewer.")
    spec = planned_episode_of(load_demo())
    measured: dict[int, list[Ticks]] = {count: [] for count in counts}
    for number in range(rounds):
        for turn, count in enumerate(counts if number % 2 else reversed(counts)):
            measured[count].append(_ticks(spec, cores[:count]))
            progress(number * len(counts) + turn + 1, rounds * len(counts))
    return judge(measured)


def judge(measured: dict[int, list[Ticks]]) -> Verdict:
    """The figures of recordings by the number of cores."""
    figures = [Figure("cores", max(measured)), Figure("rounds", len(measured[max(measured)]))]
    wall_s: dict[int, float] = {}
    for count, ticks in measured.items():
        wall_s[count] = statistics.median(one.wall_s for one in ticks)
        cpu_s = statistics.median(one.server_cpu_s for one in ticks)
        figures.append(Figure(f"ms_per_tick_{count}_cores", wall_s[count] * 1e3))
        figures.append(Figure(f"server_cpu_ms_per_tick_{count}_cores", cpu_s * 1e3))
    few, many = min(wall_s), max(wall_s)
    if few < many:
        target = _LEAST_GAIN if (few, many) == (_FEW, _MANY) else None
        ratio = wall_s[few] / wall_s[many]
        figures.append(Figure(f"faster_by_{many}_cores_than_by_{few}", ratio, ">=", target))
    return Verdict("cores", tuple(figures))


@contextmanager
def _held_to(cores: Sequence[int]) -> Iterator[None]:
    """What is started in the block may use these cores alone."""
    usual = os.sched_getaffinity(0)
    os.sched_setaffinity(0, cores)
    try:
        yield
    finally:
        os.sched_setaffinity(0, usual)


def _ticks(spec: EpisodeSpec, cores: Sequence[int]) -> Ticks:
    """One recording of a server with these cores."""
    with ExitStack() as resources:
        folder = resources.enter_context(tempfile.TemporaryDirectory(prefix="carstage-bench-"))
        server = EmbeddedServer(port=allot_ports().rpc, map_name=spec.map)
        with _held_to(cores):
            resources.enter_context(server)
        pid = server.endpoint.pid
        assert pid is not None
        client = resources.enter_context(
            CollectorProcess(
                client_plan(spec, server.endpoint, Path(folder) / "files"),
                plan_path=Path(folder) / "plan.json",
                log_path=Path(folder) / "client.log",
                module=_DISCARD,
            )
        )
        readings = [
            (time.monotonic(), process_cpu_s(pid))
            for event in events_of(client)
            if event["event"] == "tick"
        ]
    (began_s, cpu_before_s), (ended_s, cpu_after_s) = readings[0], readings[-1]
    ticks = spec.steps - 1  # the first is reported when its data are not there yet
    return Ticks((ended_s - began_s) / ticks, (cpu_after_s - cpu_before_s) / ticks)
