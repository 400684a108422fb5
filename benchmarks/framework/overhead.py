"""What capture costs the tick and the machine, against a client that drops everything.

The collector as it ships and a client that ticks the same scene and drops all data take turns on
one server that repeats rendered frames, so that what they have in common (the client library, its
sockets, the Traffic Manager) cancels out. CPU time of the main thread shows what capture adds to
the tick; CPU time of the whole process shows what writing the raw log costs. Both are scaled by a
calibration kernel that is timed between the blocks.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.framework.recordings import drop_segment, seals_segment, server_for
from benchmarks.process_figures import main_thread_cpu_s
from carstage.bench.calibration import slowness
from carstage.bench.episodes import (
    Progress,
    camera,
    client_plan,
    events_of,
    planned_episode,
    roof_sensor,
)
from carstage.bench.process_figures import process_cpu_s
from carstage.bench.verdict import Figure, Verdict
from carstage.execution import CollectorProcess
from carstage.rawlog.reader import EpisodeLog
from carstage.server import Endpoint
from carstage.spec import EpisodeSpec

CAMERAS = 5
POINTS = 100_000
POINT_BYTES = 16
TARGET_TICK_MS = 0.5
TARGET_CAMERA_FRAME_MS = 2.0
_FPS = 10
_LOOP = 2
_CAPTURE, _DISCARD = "carstage.collector", "carstage.bench.clients.discard"


@dataclass(frozen=True, slots=True)
class Block:
    """What one client used from its first tick to its last one.

    Attributes:
        ticks: how many.
        main_thread_s: CPU seconds of the thread that ticks.
        process_s: CPU seconds of all threads, until every byte was written.
        wall_s: time that passed.
        lidar_points: points of the first cloud; 0 when nothing was recorded.
    """

    ticks: int
    main_thread_s: float
    process_s: float
    wall_s: float
    lidar_points: int = 0


def measure_overhead(
    *,
    ticks: int = 200,
    rounds: int = 3,
    size: tuple[int, int] = (1280, 720),
    raw_store: str = "chunklog",
    scratch: Path | None = None,
    progress: Progress = lambda done, total: None,
    running: Endpoint | None = None,
) -> Verdict:
    """Let both clients take turns.

    Args:
        ticks: of each block.
        rounds: blocks of each client.
        size: of the pictures; targets hold for 1280x720 and less.
        raw_store: how payloads of cameras are stored.
        scratch: where the raw logs go for a moment, on the disk that shall be measured.
        progress: called with the blocks done and their total number.
        running: the server; None starts one.
    """
    spec = planned_episode(overhead_rig(ticks, size))
    captured: list[Block] = []
    discarded: list[Block] = []
    slow: list[float] = []
    with (
        tempfile.TemporaryDirectory(prefix="carstage-bench-", dir=scratch) as folder,
        server_for(_LOOP, running) as endpoint,
    ):
        for number in range(rounds):
            slow.append(slowness())
            # Turns are swapped, so that what changes with time does not favour one of them.
            turns = [(_CAPTURE, captured), (_DISCARD, discarded)]
            for module, blocks in turns if number % 2 == 0 else reversed(turns):
                where = Path(folder) / f"{number}-{module}"
                where.mkdir()
                blocks.append(_block(module, spec, endpoint, where, raw_store))
                progress(len(captured) + len(discarded), 2 * rounds)
    return judge(captured, discarded, max(1.0, statistics.median(slow)), raw_store)


def overhead_rig(ticks: int, size: tuple[int, int]) -> dict[str, Any]:
    """Five cameras and a LiDAR whose every ray meets the ground, in ordinary traffic."""
    lidar = {
        "channels": 64,
        "points_per_second": POINTS * _FPS,
        "range_m": 200.0,
        "upper_fov_deg": -2.0,
        "lower_fov_deg": -25.0,
    }
    return {
        "fps": _FPS,
        "duration_s": ticks / _FPS,
        "image_size": list(size),
        "vehicles": {"count": 20},
        "pedestrians": {"count": 10},
        "rig": {
            "sensors": [
                *(camera(f"CAM_{number}") for number in range(CAMERAS)),
                roof_sensor("LIDAR", "lidar", **lidar),
            ]
        },
    }


def _block(
    module: str, spec: EpisodeSpec, endpoint: Endpoint, folder: Path, raw_store: str
) -> Block:
    raw = folder / "raw"
    begin: tuple[float, float, float] | None = None
    end: tuple[float, float, float] | None = None
    points = 0
    client = CollectorProcess(
        {**client_plan(spec, endpoint, raw), "raw_store": raw_store},
        plan_path=folder / "plan.json",
        log_path=folder / "client.log",
        module=module,
    )
    with client:
        for event in events_of(client):
            segment = seals_segment(event)
            if segment == 0:
                record = EpisodeLog(raw).read_segment("LIDAR", 0)[0]
                points = record.payload.nbytes // POINT_BYTES
            if _is_tick(event, 0):
                begin = _reading(client.pid)
            elif _is_tick(event, spec.steps - 1) or segment is not None:
                end = _reading(client.pid)  # the last one counts: all is ticked, all is written
            if segment is not None:
                drop_segment(raw, segment, (sensor.id for sensor in spec.sensors))
    assert begin is not None
    assert end is not None
    main_s, process_s, wall_s = (after - before for after, before in zip(end, begin, strict=True))
    return Block(spec.steps - 1, main_s, process_s, wall_s, points)


def _is_tick(event: Mapping[str, Any], tick: int) -> bool:
    return bool(event["event"] == "tick" and event["tick"] == tick)


def _reading(pid: int) -> tuple[float, float, float]:
    return main_thread_cpu_s(pid), process_cpu_s(pid), time.monotonic()


def judge(
    captured: list[Block], discarded: list[Block], slow: float, raw_store: str = "chunklog"
) -> Verdict:
    """The figures of blocks that were measured on a machine ``slow`` times slower than planned."""

    def per_tick_ms(blocks: list[Block], what: str) -> float:
        seconds = [float(getattr(block, what)) / block.ticks for block in blocks]
        return 1e3 * statistics.median(seconds)

    added = {
        what: per_tick_ms(captured, what) - per_tick_ms(discarded, what)
        for what in ("main_thread_s", "process_s")
    }
    logging_ms = (added["process_s"] - added["main_thread_s"]) / CAMERAS
    return Verdict(
        "overhead",
        (
            Figure("machine_slowness", slow),
            Figure("ticks_of_each_client", sum(block.ticks for block in captured)),
            Figure("lidar_points", min(block.lidar_points for block in captured), ">=", POINTS),
            Figure("tick_thread_cpu_ms_added", added["main_thread_s"]),
            Figure(
                "scaled_tick_thread_cpu_ms_added",
                added["main_thread_s"] / slow,
                "<=",
                TARGET_TICK_MS,
            ),
            Figure("logging_cpu_ms_per_camera_frame", logging_ms),
            Figure(
                "scaled_logging_cpu_ms_per_camera_frame",
                logging_ms / slow,
                "<=",
                TARGET_CAMERA_FRAME_MS,
            ),
            Figure("tick_thread_cpu_ms_capturing", per_tick_ms(captured, "main_thread_s")),
            Figure("tick_thread_cpu_ms_discarding", per_tick_ms(discarded, "main_thread_s")),
            Figure("client_cpu_ms_per_tick_capturing", per_tick_ms(captured, "process_s")),
            Figure("client_cpu_ms_per_tick_discarding", per_tick_ms(discarded, "process_s")),
            Figure("wall_ms_per_tick_capturing", per_tick_ms(captured, "wall_s")),
            Figure("wall_ms_per_tick_discarding", per_tick_ms(discarded, "wall_s")),
        ),
        (
            f"{CAMERAS} cameras and a LiDAR, raw store {raw_store}; medians of "
            f"{len(captured)} blocks of each client.",
            "Logging counts the LiDAR, the world and the ledger too, shared out over the cameras.",
        ),
    )
