"""What the converting processes of a run cost before they have converted anything."""

from __future__ import annotations

import resource
import subprocess
import sys

from carstage.bench.verdict import Figure, Verdict

MANY = 8
TARGET_RATIO = 1.5

_PROGRAM = """
import resource, sys, time
from concurrent.futures import wait
from carstage.runs.converters import start_pool

workers = int(sys.argv[1])
with start_pool(workers, True) as pool:
    wait([pool.submit(time.sleep, 0.2) for _ in range(workers)])
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime)
"""
"""Each worker sleeps once, so that as many are needed; what pictures need is loaded, too."""


def _cpu_s(workers: int) -> float:
    """CPU seconds of a pool's processes; kernels are compiled before."""
    answer = subprocess.run(
        [sys.executable, "-c", _PROGRAM, str(workers)], capture_output=True, text=True, check=True
    )
    return float(answer.stdout)


def measure_converters(*, rounds: int = 3) -> Verdict:
    """The least of several rounds, one and many by turns."""
    _cpu_s(1)
    tries = [(_cpu_s(1), _cpu_s(MANY)) for _ in range(rounds)]
    one, many = (min(costs) for costs in zip(*tries, strict=True))
    largest_kb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return Verdict(
        "converters",
        (
            Figure("cpu_s_of_1_worker", one),
            Figure(f"cpu_s_of_{MANY}_workers", many),
            Figure("ratio", many / one, "<=", TARGET_RATIO),
            Figure("largest_process_mb", largest_kb * 1024 / 1e6),
        ),
    )
