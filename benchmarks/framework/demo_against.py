"""The demo of this code and of another installation, in turns: same data, and at what cost?

The other one is named by its Python, in whose environment that ``carstage`` is installed. Both
record the demo once to fill their caches, then as often as asked, one after the other. CPU time is
that of all processes of a demo, user and system. Datasets are compared by their decoded values.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from benchmarks.framework.same_contents import compare_datasets
from carstage.bench.verdict import Figure, Verdict

MOST_CPU_RATIO = 1.03


def _demo(python: str, out: Path) -> float:
    """CPU seconds of one demo.

    Raises:
        subprocess.CalledProcessError: it failed.
    """
    before = os.times()
    subprocess.run(
        [python, "-m", "carstage.cli", "demo", "--out", str(out)],
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    after = os.times()
    return (after.children_user - before.children_user) + (
        after.children_system - before.children_system
    )


def measure_demo_against(
    other: str,
    rounds: int = 5,
    scratch: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Record and compare.

    Args:
        other: the Python of the other installation.
        rounds: demos of each that count.
        scratch: existing folder for the datasets.
        progress: called with the demos done and their total number.
    """
    pythons = (sys.executable, other)
    total = 2 * (rounds + 1)
    done = 0
    ratios: list[float] = []
    seconds: tuple[list[float], list[float]] = ([], [])
    with tempfile.TemporaryDirectory(prefix="carstage-demo-", dir=scratch) as folder:
        for number in range(rounds + 1):
            pair = []
            for side, python in enumerate(pythons):
                pair.append(_demo(python, Path(folder) / f"{number}-{side}"))
                done += 1
                progress(done, total)
            if number:  # the first one of each fills its caches
                ratios.append(pair[0] / pair[1])
                for side in (0, 1):
                    seconds[side].append(pair[side])
        found = compare_datasets(Path(folder) / "0-0", Path(folder) / "0-1")
    return Verdict(
        "demo-against",
        (
            Figure("data_compared", found.data, ">=", 1),
            Figure("label_rows_compared", found.rows, ">=", 1),
            Figure("differences", len(found.differences), "==", 0),
            Figure("cpu_ratio_median", statistics.median(ratios), "<=", MOST_CPU_RATIO),
            Figure("cpu_ratio_min", min(ratios)),
            Figure("cpu_ratio_max", max(ratios)),
            Figure("cpu_s_this", statistics.median(seconds[0])),
            Figure("cpu_s_other", statistics.median(seconds[1])),
        ),
        [*found.differences[:20], *(f"only one has {name}" for name in sorted(found.renamed))],
    )
