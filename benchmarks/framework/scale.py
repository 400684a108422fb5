"""How much more several workers record in the same time, and what Ray costs over local processes.

One configuration is recorded by the real command with one worker and with several, in turns, as
many episodes for each worker. Every worker has the same threads and converters, so a figure is what
another worker adds. The time is that between the first step and the last commit: what a campaign
of many episodes takes, without the start of the servers.
"""

from __future__ import annotations

import json
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.all_processes import run_counted
from benchmarks.loopback_only import ALONE
from carstage.bench.verdict import Figure, Verdict

TARGETS: Mapping[int, float] = {2: 1.8, 8: 6.5}
"""How many times as much so many workers have to record as one."""
TARGET_RAY = 1.10
_FRAMES_PER_S = 10
_CONFIG = """
name: scale
seed: 7
episodes: {episodes}
duration_s: {duration_s}
fps: 10
image_size: [320, 180]
vehicles: {{count: 10}}
pedestrians: {{count: 5}}
conversion: {{workers: 1}}
rig: {{preset: demo}}
server: {{threads: {threads}, self_test: "off"}}
"""


@dataclass(frozen=True, slots=True)
class Campaign:
    """What one command did.

    Attributes:
        frames: that it committed.
        seconds: from its first step to its last commit.
        start_s: from the command to its first step: Ray's start, then that of workers and servers.
        whole_s: of the whole command.
        cpu_s: of all its processes, Ray's too.
    """

    frames: int
    seconds: float
    start_s: float
    whole_s: float
    cpu_s: float


def measure_scale(
    workers: Sequence[int],
    *,
    episodes: int,
    duration_s: float,
    threads: int,
    rounds: int,
    ray: bool,
    scratch: Path | None,
    progress: Callable[[int, int], None],
) -> Verdict:
    """Let numbers of workers take turns.

    Args:
        workers: the numbers, beside one.
        episodes: of each worker in each round.
        duration_s: of an episode, simulated.
        threads: that each worker's simulator computes with.
        rounds: how often each has its turn.
        ray: compare local processes with Ray instead.
        scratch: where datasets are made.
        progress: called with how many commands are done, and of how many.
    """
    kinds = [(count, name) for count in workers for name in ("processes", "ray")]
    turns = kinds if ray else [(count, "processes") for count in dict.fromkeys((1, *workers))]
    done: dict[tuple[int, str], list[Campaign]] = {turn: [] for turn in turns}
    total, count = rounds * len(turns) + 1, 0
    with tempfile.TemporaryDirectory(dir=scratch) as folder:
        place = Path(folder)
        _record(place / "warm", 1, "processes", 1, 1.0, threads)  # compiles, computes the town
        for number in range(rounds):
            for turn in turns if number % 2 == 0 else turns[::-1]:
                count += 1
                progress(count, total)
                out = place / f"{number}-{turn[0]}-{turn[1]}"
                done[turn].append(_record(out, *turn, episodes * turn[0], duration_s, threads))
        progress(total, total)
    figures = _ray_figures(workers, done) if ray else _scale_figures(workers, done)
    notes = [
        f"{len(os.sched_getaffinity(0))} cores; each worker has {threads} thread(s), 1 converter",
        f"load of the machine at the end: {os.getloadavg()[0]:.1f}",
    ]
    return Verdict("scale-ray" if ray else "scale", tuple(figures), notes)


def _scale_figures(
    workers: Sequence[int], done: Mapping[tuple[int, str], list[Campaign]]
) -> list[Figure]:
    one = done[1, "processes"]
    figures = [Figure("rounds", len(one)), *_of(one, "1")]
    for count in workers:
        if count == 1:
            continue
        several = done[count, "processes"]
        ratios = [_rate(many) / _rate(single) for many, single in zip(several, one, strict=True)]
        target = TARGETS.get(count)
        figures += _of(several, str(count))
        figures.append(Figure(f"times_as_much_with_{count}", _median(ratios), ">=", target))
        figures.append(Figure(f"times_as_much_with_{count}_best_round", max(ratios)))
        cpu = [
            (many.cpu_s / many.frames) / (single.cpu_s / single.frames)
            for many, single in zip(several, one, strict=True)
        ]
        figures.append(Figure(f"cpu_per_frame_with_{count}_over_1", _median(cpu)))
    return figures


def _ray_figures(
    workers: Sequence[int], done: Mapping[tuple[int, str], list[Campaign]]
) -> list[Figure]:
    figures = []
    for count in workers:
        local, ray = done[count, "processes"], done[count, "ray"]
        pairs = list(zip(ray, local, strict=True))
        kinds = (("processes", local), ("actors", ray))
        figures += [Figure("rounds", len(pairs))]
        for name, campaigns in kinds:
            of = f"of_{count}_{name}"
            figures += [
                Figure(f"seconds_{of}", _median([one.seconds for one in campaigns])),
                Figure(f"cpu_s_{of}", _median([one.cpu_s for one in campaigns])),
                Figure(f"start_s_{of}", _median([one.start_s for one in campaigns])),
                Figure(f"whole_command_s_{of}", _median([one.whole_s for one in campaigns])),
            ]
        wall, cpu, more_s = (
            _median([one.seconds / other.seconds for one, other in pairs]),
            _median([one.cpu_s / other.cpu_s for one, other in pairs]),
            _median([one.start_s - other.start_s for one, other in pairs]),
        )
        figures += [
            Figure(f"ray_over_processes_with_{count}", wall, "<=", TARGET_RAY),
            Figure(f"cpu_of_ray_over_processes_with_{count}", cpu),
            Figure(f"later_first_step_of_ray_with_{count}_s", more_s),
        ]
    return figures


def _of(campaigns: Sequence[Campaign], name: str) -> list[Figure]:
    return [
        Figure(f"frames_per_s_with_{name}", _median([_rate(one) for one in campaigns])),
        Figure(f"cpu_s_per_frame_with_{name}", _median([o.cpu_s / o.frames for o in campaigns])),
    ]


def _rate(campaign: Campaign) -> float:
    return campaign.frames / campaign.seconds


def _median(values: Sequence[float]) -> float:
    return float(statistics.median(values))


def _record(
    out: Path, workers: int, kind: str, episodes: int, duration_s: float, threads: int
) -> Campaign:
    """Record a dataset by the real command.

    Raises:
        RuntimeError: it failed.
    """
    config = out.with_suffix(".yaml")
    config.write_text(_CONFIG.format(episodes=episodes, duration_s=duration_s, threads=threads))
    command = [sys.executable, "-m", "carstage.cli", "run", str(config), "--out", str(out)]
    command += ["--workers", str(workers), "--json"]
    if kind == "ray":  # it listens on all interfaces
        resources = json.dumps({"CPU": threads})
        command = [*ALONE, *command, "--ray-address", "local", "--ray-resources", resources]
    log = out.with_suffix(".log")
    begun_s, clock_s = time.time(), time.monotonic()
    code, cpu_s = run_counted(command, log)
    whole_s = time.monotonic() - clock_s
    said = log.read_text("utf-8", "replace")
    if code:
        raise RuntimeError(f"{' '.join(command)} failed:\n{said[-4000:]}")
    (result,) = (json.loads(line) for line in said.splitlines() if line.startswith('{"'))
    frames = result["frames"]
    assert frames == round(episodes * duration_s * _FRAMES_PER_S)
    (events,) = (out / "runs").glob("*/events.jsonl")
    lines: list[dict[str, Any]] = [json.loads(line) for line in events.read_text().splitlines()]
    begin_s = min(line["time"] for line in lines if line["event"] == "episode_started")
    end_s = max(line["time"] for line in lines if line["event"] == "episode_committed")
    return Campaign(frames, end_s - begin_s, begin_s - begun_s, whole_s, cpu_s)
