"""What it takes to validate and to export a dataset, in one process and in many."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.framework.recorded import record_demo
from carstage.bench.calibration import slowness
from carstage.bench.verdict import Figure, Verdict

MANY = 8
TARGET_RATIO = 1.5
"""Of the CPU time of an export by many processes and by one."""

_VALIDATE = """
import carstage
said = carstage.validate(dataset, workers=workers).to_json()
"""
_EXPORT = """
import carstage, tempfile
with tempfile.TemporaryDirectory() as folder:
    said = carstage.export("coco", dataset, folder + "/out", workers=workers).frames
"""
_MEASURED = """
import json, resource, sys, time
dataset, workers = sys.argv[1], int(sys.argv[2])
began = time.monotonic()
{}
wall_s = time.monotonic() - began
spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
cpu_s = sum(one.ru_utime + one.ru_stime for one in spent)
print(json.dumps([wall_s, cpu_s, said]))
"""


@dataclass(frozen=True, slots=True)
class _Try:
    """What one process and those that it started took, and what they found."""

    wall_s: float
    cpu_s: float
    said: Any


def _tried(program: str, dataset: Path, workers: int) -> _Try:
    answer = subprocess.run(
        [sys.executable, "-c", _MEASURED.format(program), str(dataset), str(workers)],
        capture_output=True,
        text=True,
        check=True,
    )
    return _Try(*json.loads(answer.stdout.splitlines()[-1]))


def measure_sharing(
    dataset: Path | None = None,
    *,
    rounds: int = 3,
    progress: Callable[[int, int], None] | None = None,
) -> Verdict:
    """Validate in no other process, in one and in as many as there are cores; export in 1 and 8.

    Args:
        dataset: a dataset's folder; None: a demonstration is recorded.
        rounds: how often, in turns; medians count.
        progress: called with (rounds done, rounds in all).

    Raises:
        RuntimeError: no demonstration could be recorded.
    """
    with tempfile.TemporaryDirectory(prefix="carstage-bench-") as scratch:
        if dataset is None:
            dataset = Path(scratch, "demo")
            record_demo(dataset, 5.0)
        cores = len(os.sched_getaffinity(0))
        ways = [(_VALIDATE, workers) for workers in sorted({0, 1, cores})]
        ways += [(_EXPORT, workers) for workers in (1, MANY)]
        tries: dict[tuple[str, int], list[_Try]] = {way: [] for way in ways}
        for done in range(rounds):
            for way, found in tries.items():
                found.append(_tried(way[0], dataset, way[1]))
            if progress is not None:
                progress(done + 1, rounds)
    walls = {way: statistics.median(one.wall_s for one in found) for way, found in tries.items()}
    spent = {way: statistics.median(one.cpu_s for one in found) for way, found in tries.items()}
    validated = [one.said for way, found in tries.items() if way[0] == _VALIDATE for one in found]
    exported = {one.said for way, found in tries.items() if way[0] == _EXPORT for one in found}
    figures = [
        Figure("machine_slowness", slowness()),
        Figure("cores", cores),
        Figure("valid", json.loads(validated[0])["ok"], "==", True),
        Figure("verdicts_that_differ", len(set(validated)) - 1, "==", 0),
    ]
    for program, workers in ways:
        name = "validate" if program == _VALIDATE else "export"
        figures.append(Figure(f"{name}_wall_s_with_{workers}", walls[program, workers]))
        figures.append(Figure(f"{name}_cpu_s_with_{workers}", spent[program, workers]))
    figures += [
        Figure("validate_speedup", walls[_VALIDATE, 0] / walls[_VALIDATE, cores]),
        Figure("exports_that_differ", len(exported) - 1, "==", 0),
        Figure("export_cpu_ratio", spent[_EXPORT, MANY] / spent[_EXPORT, 1], "<=", TARGET_RATIO),
    ]
    return Verdict("sharing", tuple(figures))
