"""Does the memory of a recording stay within its budget while the disk is slow?

The collector records thousands of frames onto a disk that takes less than the sensors bring: its
queue fills, ticks have to wait, and memory must not grow beyond the budget. The queue is what the
collector itself counts; resident memory is what the kernel reports, above that at the first tick.
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.framework.recordings import drop_segment, seals_segment, server_for
from carstage.bench.episodes import (
    Progress,
    camera,
    client_plan,
    events_of,
    planned_episode,
    roof_sensor,
)
from carstage.bench.process_figures import resident_bytes
from carstage.bench.verdict import Figure, Verdict
from carstage.execution import CollectorProcess
from carstage.server import Endpoint

FRAMES = 10_000
BUDGET_BYTES = 64 * 1024 * 1024
DISK_BYTES_PER_S = 12e6
TOLERANCE = 0.05
_CAMERAS = 5
_LOOP = 4
_FPS = 10
_CLIENT = "benchmarks.framework.clients.slow_disk"


class Sample(NamedTuple):
    """The collector at one tick.

    Attributes:
        tick: which one.
        queued_bytes: sensor data that wait for the disk.
        waited_s: how long ticks have waited so far.
        resident_bytes: memory of the process, without pages of files.
    """

    tick: int
    queued_bytes: int
    waited_s: float
    resident_bytes: int


def measure_memory(
    *,
    frames: int = FRAMES,
    budget_bytes: int = BUDGET_BYTES,
    disk_bytes_per_s: float = DISK_BYTES_PER_S,
    scratch: Path | None = None,
    progress: Progress = lambda done, total: None,
    running: Endpoint | None = None,
) -> Verdict:
    """Record on a slow disk and look at the memory some ten times a second.

    Args:
        frames: to record.
        budget_bytes: of the collector's queue.
        disk_bytes_per_s: what the disk takes; less than the sensors bring.
        scratch: where the raw log goes, segment by segment.
        progress: called with the ticks recorded and their total number.
        running: the server; None starts one.
    """
    spec = planned_episode(_rig(frames))
    samples: list[Sample] = []
    with (
        tempfile.TemporaryDirectory(prefix="carstage-bench-", dir=scratch) as name,
        server_for(_LOOP, running) as endpoint,
    ):
        folder = Path(name)
        plan = client_plan(spec, endpoint, folder / "raw")
        client = CollectorProcess(
            {**plan, "queue_bytes": budget_bytes, "disk_bytes_per_s": disk_bytes_per_s},
            plan_path=folder / "plan.json",
            log_path=folder / "collector.log",
            module=_CLIENT,
        )
        with client:
            for event in events_of(client):
                if event["event"] == "tick":
                    progress(event["tick"] + 1, frames)
                    samples.append(
                        Sample(
                            event["tick"],
                            event["queued_bytes"],
                            event["waited_s"],
                            resident_bytes(client.pid),
                        )
                    )
                segment = seals_segment(event)
                if segment is not None:
                    drop_segment(folder / "raw", segment, (s.id for s in spec.sensors))
    return judge(samples, frames, budget_bytes)


def judge(samples: Sequence[Sample], frames: int, budget_bytes: int) -> Verdict:
    """The figures of a recording: how full the queue was, how large the process became."""
    begin = samples[0].resident_bytes
    tenth = max(1, len(samples) // 10)
    # The first tenth fills the queue; from then on nothing may grow.
    early = statistics.fmean(s.resident_bytes for s in samples[tenth : 2 * tenth])
    late = statistics.fmean(s.resident_bytes for s in samples[-tenth:])
    queued = max(s.queued_bytes for s in samples) / budget_bytes
    grown = (max(s.resident_bytes for s in samples) - begin) / budget_bytes
    return Verdict(
        "memory",
        (
            Figure("frames", samples[-1].tick + 1, "==", frames),
            Figure("budget_mb", budget_bytes / 1e6),
            Figure("ticks_waited_s", samples[-1].waited_s, ">=", 0.1),
            Figure("largest_queue_of_budget", queued, "<=", 1.0 + TOLERANCE),
            Figure("queue_that_shows_the_bound", queued, ">=", 1.0 - 2 * TOLERANCE),
            Figure("resident_above_first_tick_of_budget", grown, "<=", 1.0 + TOLERANCE),
            Figure("resident_mb_at_first_tick", begin / 1e6),
            Figure("resident_mb_in_second_tenth", early / 1e6),
            Figure("resident_mb_in_last_tenth", late / 1e6),
            Figure("growth_from_second_to_last_tenth", late / early - 1.0, "<=", TOLERANCE),
        ),
        (f"{_CAMERAS} cameras of 320x180 and a LiDAR; {len(samples)} samples.",),
    )


def _rig(frames: int) -> dict[str, Any]:
    return {
        "fps": _FPS,
        "duration_s": frames / _FPS,
        "image_size": [320, 180],
        "vehicles": {"count": 0},
        "pedestrians": {"count": 0},
        "rig": {
            "sensors": [
                *(camera(f"CAM_{number}") for number in range(_CAMERAS)),
                roof_sensor("LIDAR", "lidar", channels=16, points_per_second=50_000),
            ]
        },
    }
