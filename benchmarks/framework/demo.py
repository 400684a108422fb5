"""The demo as a stranger runs it: wall time with empty and warm caches, memory, CPU time.

Two demos run one after the other with a home and cache folder of their own: the first finds them
empty (kernels are compiled, the town is baked), the second warm. Memory is the largest sum of the
proportional set sizes (PSS) of all its processes, sampled twice a second. Targets in seconds are
those of the reference machine, scaled by a calibration kernel that is timed in the same run. What
its first picture shows is counted, too: people, moving cars, and those that cross before the ego.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import psutil

from carstage.bench.calibration import slowness
from carstage.bench.verdict import Figure, Verdict
from carstage.dataset import Dataset

TARGET_COLD_S, TARGET_WARM_S = 60.0, 30.0
TARGET_WARM_OF_MANY_CORES_S = 12.0
_MANY_CORES = 16
TARGET_PSS_BYTES = 2_000_000_000
TARGET_PEOPLE, TARGET_MOVING_CARS = 5, 5
_SAMPLE_EVERY_S = 0.5
_MOVES_M_S = 0.5
_CARS = ("car", "van", "truck", "bus")
"""Classes of four wheels or more: two-wheelers and their riders do not count as cars."""


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


def measure_demo() -> Verdict:
    """Run the demo with empty caches, then with warm ones."""
    factor = max(1.0, slowness())
    cores = len(os.sched_getaffinity(0))
    warm_s = TARGET_WARM_OF_MANY_CORES_S if cores >= _MANY_CORES else TARGET_WARM_S
    with tempfile.TemporaryDirectory(prefix="carstage-bench-") as scratch:
        folder = Path(scratch)
        (folder / "home").mkdir()
        cold = measure(folder / "cold", folder / "home")
        warm = measure(folder / "warm", folder / "home")
        seen = first_picture(folder / "warm") if warm.exit_code == 0 else ()
    return Verdict(
        "demo",
        (
            Figure("machine_slowness", factor),
            Figure("cores", cores),
            *_figures("cold", cold, TARGET_COLD_S * factor),
            *_figures("warm", warm, warm_s * factor),
            *seen,
        ),
        ("targets in seconds are scaled by the machine's slowness",),
    )


def first_picture(dataset: Path) -> tuple[Figure, ...]:
    """What a demo's front camera sees in its first frame, by the labels."""
    episode = Dataset(dataset).episodes[0]
    frame = next(iter(episode.iter_frames()))
    people, moving, crossing = 0, 0, 0
    for row in frame.camera_objects["CAM_FRONT"]:
        known = frame.objects[row["track_id"]]
        if not row["visible"]:
            continue
        if known["class"].startswith("walker"):
            people += 1
        elif known["class"] in _CARS and math.hypot(*known["velocity"][:2]) > _MOVES_M_S:
            ahead_m_s, across_m_s, _ = known["velocity_ego"]
            moving += 1
            crossing += abs(across_m_s) > abs(ahead_m_s)
    return (
        Figure("people_in_the_first_picture", people, ">=", TARGET_PEOPLE),
        Figure("moving_cars_in_it", moving, ">=", TARGET_MOVING_CARS),
        Figure("of_them_crossing", crossing, ">=", 1),
    )


def _figures(name: str, demo: DemoFigures, target_s: float) -> tuple[Figure, ...]:
    return (
        Figure(f"{name}_exit_code", demo.exit_code, "==", 0),
        Figure(f"{name}_wall_s", demo.wall_s, "<=", target_s),
        Figure(f"{name}_cpu_s", demo.cpu_s),
        Figure(f"{name}_peak_pss_mb", demo.peak_pss_bytes / 1e6, "<=", TARGET_PSS_BYTES / 1e6),
    )
