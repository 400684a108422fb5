"""The demonstration on a machine that has much else to do: the same files as on a calm one?

A demo is recorded while nothing else runs, then others while processes that only count keep every
core busy several times over. An attempt that the run gave up says why in the run's events.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.framework.recorded import hashes, record_demo
from carstage.bench.verdict import Figure, Verdict

DEMOS = 20
PER_CORE = 3


def _count_for_ever() -> None:
    number = 0
    while True:
        number += 1


@contextmanager
def busy_processes(count: int) -> Iterator[None]:
    """That many processes which do nothing but use a core."""
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=_count_for_ever, daemon=True) for _ in range(count)]
    try:
        for process in processes:
            process.start()
        yield
    finally:
        for process in processes:
            process.kill()
            process.join()


def _repeats(out: Path) -> list[str]:
    """Why attempts of a run were repeated."""
    reasons = []
    for path in sorted(out.glob("runs/*/events.jsonl")):
        events = map(json.loads, path.read_text().splitlines())
        reasons += [e["reason"] for e in events if e["event"] == "episode_retried"]
    return reasons


def measure_busy_machine(
    demos: int = DEMOS,
    per_core: int = PER_CORE,
    seconds: float = 5.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
    *,
    size: tuple[int, int] | None = None,
) -> Verdict:
    """Record one demo calmly and the others under load, and compare every file.

    Args:
        demos: recorded under load.
        per_core: busy processes for each core that this process may use.
        seconds: simulated ones of each demo.
        progress: called with the demos done and their total number.
        size: width and height of their pictures (px); None: those of the demonstration.
    """
    count = per_core * len(os.sched_getaffinity(0))
    notes: list[str] = []
    differing = compared = repeated = 0
    with tempfile.TemporaryDirectory(prefix="carstage-busy-") as scratch:
        calm = hashes(record_demo(Path(scratch) / "calm", seconds, size=size))
        progress(1, demos + 1)
        with busy_processes(count):
            for number in range(demos):
                out = Path(scratch) / str(number)
                files, reasons = hashes(record_demo(out, seconds, size=size)), _repeats(out)
                others = sorted(n for n in {*calm, *files} if calm.get(n) != files.get(n))
                compared += len(calm)
                differing += len(others)
                repeated += len(reasons)
                notes += [f"demo {number}: {name} differs" for name in others[:5]]
                notes += [f"demo {number} was repeated: {reason}" for reason in reasons]
                progress(number + 2, demos + 1)
    return Verdict(
        "busy-machine",
        (
            Figure("demos", demos, ">=", 1),
            Figure("busy_processes", count, ">=", 1),
            Figure("files_compared", compared, ">=", 1),
            Figure("files_that_differ", differing, "==", 0),
            Figure("attempts_repeated", repeated),
        ),
        notes,
    )
