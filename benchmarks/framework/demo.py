"""The demo as a stranger runs it: wall time with empty and warm caches, memory, CPU time.

    python -m benchmarks.framework.demo [--json]

Two demos run one after the other with a home and cache folder of their own: the first finds them
empty (kernels are compiled, the town is baked), the second warm. Memory is the largest sum of the
proportional set sizes (PSS) of all its processes, sampled twice a second. Targets in seconds are
those of the reference machine, scaled by a calibration kernel that is timed in the same run.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from carstage.bench.calibration import slowness

TARGET_COLD_S = 180.0
TARGET_WARM_S = 90.0
TARGET_PSS_BYTES = 2_000_000_000
_SAMPLE_EVERY_S = 0.5


@dataclass(frozen=True, slots=True)
class DemoFigures:
    """One demo: wall seconds, CPU seconds of all processes, peak PSS in bytes, exit code."""

    wall_s: float
    cpu_s: float
    peak_pss_bytes: int
    exit_code: int


def measure(out: Path, home: Path) -> DemoFigures:
    """Run the demo into ``out`` with its caches below ``home``."""
    environment = {**os.environ, "HOME": str(home), "XDG_CACHE_HOME": str(home / ".cache")}
    environment.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-m", "carstage.cli", "demo"]
    before = os.times()
    started = time.monotonic()
    peak = 0
    with subprocess.Popen(
        [*command, "--out", str(out)],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as demo:
        while True:
            peak = max(peak, _pss_bytes(demo.pid))
            try:
                exit_code = demo.wait(timeout=_SAMPLE_EVERY_S)
                break
            except subprocess.TimeoutExpired:
                continue
    after = os.times()
    cpu_s = (after.children_user - before.children_user) + (
        after.children_system - before.children_system
    )
    return DemoFigures(time.monotonic() - started, cpu_s, peak, exit_code)


def _pss_bytes(pid: int) -> int:
    """Sum of the PSS of a process and all its descendants; those that just ended count nothing."""
    total = 0
    try:
        root = psutil.Process(pid)
        family = [root, *root.children(recursive=True)]
    except psutil.NoSuchProcess:
        return 0
    for process in family:
        try:
            total += process.memory_full_info().pss
        except (psutil.NoSuchProcess, psutil.ZombieProcess, psutil.AccessDenied):
            continue
    return total


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, and return 0 when every target is met."""
    parser = argparse.ArgumentParser(prog="benchmarks.framework.demo", description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    wanted = parser.parse_args(argv)
    factor = max(1.0, slowness())
    with tempfile.TemporaryDirectory(prefix="carstage-bench-") as scratch:
        folder = Path(scratch)
        (folder / "home").mkdir()
        cold = measure(folder / "cold", folder / "home")
        warm = measure(folder / "warm", folder / "home")
    figures: dict[str, Any] = {
        "cold": _row(cold, TARGET_COLD_S, factor),
        "warm": _row(warm, TARGET_WARM_S, factor),
        "machine_slowness": round(factor, 3),
        "cores": os.cpu_count(),
    }
    ok = bool(figures["cold"]["ok"] and figures["warm"]["ok"])
    for name in ("cold", "warm"):
        row = figures[name]
        _say(
            f"{name}: {row['wall_s']:.1f} s (target {row['target_s']:.0f} s, scaled "
            f"{row['scaled_target_s']:.0f} s), {row['cpu_s']:.1f} CPU s, peak PSS "
            f"{row['peak_pss_bytes'] / 1e6:.0f} MB (target {TARGET_PSS_BYTES / 1e6:.0f} MB), "
            f"exit {row['exit_code']}"
        )
    if wanted.json:
        sys.stdout.write(json.dumps({"ok": ok, **figures}) + "\n")
    return 0 if ok else 1


def _row(figures: DemoFigures, target_s: float, factor: float) -> dict[str, Any]:
    return {
        "wall_s": round(figures.wall_s, 2),
        "target_s": target_s,
        "scaled_target_s": round(target_s * factor, 1),
        "cpu_s": round(figures.cpu_s, 2),
        "peak_pss_bytes": figures.peak_pss_bytes,
        "target_pss_bytes": TARGET_PSS_BYTES,
        "exit_code": figures.exit_code,
        "ok": figures.exit_code == 0
        and figures.wall_s <= target_s * factor
        and figures.peak_pss_bytes <= TARGET_PSS_BYTES,
    }


def _say(text: str) -> None:
    sys.stderr.write(text + "\n")


if __name__ == "__main__":
    sys.exit(main())
