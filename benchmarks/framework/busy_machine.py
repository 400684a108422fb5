"""The demonstration on a machine that has much else to do: the same files as on a calm one?

A demo is recorded while nothing else runs, then others while processes that only count keep every
core busy several times over. An attempt that the run gave up says why in the run's events.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from carstage import Dataset
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


def _record(out: Path, seconds: float) -> tuple[dict[str, str], list[str]]:
    """Hash of each committed file of a demo, and the reasons of attempts that were repeated."""
    command = [sys.executable, "-m", "carstage.cli", "demo", "--out", str(out)]
    command += ["--set", f"duration_s={seconds}"]
    quiet = subprocess.DEVNULL
    subprocess.run(command, check=True, stdout=quiet, stderr=quiet)
    (episode,) = Dataset(out).episodes
    files = {entry.path: entry.hash for entry in episode.marker.files}
    reasons = []
    for path in sorted(out.glob("runs/*/events.jsonl")):
        events = map(json.loads, path.read_text().splitlines())
        reasons += [e["reason"] for e in events if e["event"] == "episode_retried"]
    return files, reasons


def measure_busy_machine(
    demos: int = DEMOS,
    per_core: int = PER_CORE,
    seconds: float = 5.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Record one demo calmly and the others under load, and compare every file.

    Args:
        demos: recorded under load.
        per_core: busy processes for each core that this process may use.
        seconds: simulated ones of each demo.
        progress: called with the demos done and their total number.
    """
    count = per_core * len(os.sched_getaffinity(0))
    notes: list[str] = []
    differing = compared = repeated = 0
    with tempfile.TemporaryDirectory(prefix="carstage-busy-") as scratch:
        calm, _ = _record(Path(scratch) / "calm", seconds)
        progress(1, demos + 1)
        with busy_processes(count):
            for number in range(demos):
                files, reasons = _record(Path(scratch) / str(number), seconds)
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
