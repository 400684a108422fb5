"""``carstage record`` beside a program that ticks as fast as it can: what is lost, what it costs.

The program runs beside the recorder, and again beside a client that attaches the same sensors, the
hidden ones of labels too, and drops their data. Both are done in turn, each time on a new server.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import psutil

from benchmarks.simulator.server_process import started_server
from carstage import Dataset, validate
from carstage.bench.verdict import Figure, Verdict
from carstage.plan.rig import plan_sensors
from carstage.runs import record_beside
from carstage.runs.rig_source import config_of, settings_of

TICKS = 5000
ROUNDS = 3
TARGET_RATIO = 1.05
_CLIENTS = Path(__file__).with_name("clients")
_HOST = "127.0.0.1"
_TIMEOUT_S = 1200.0
_SIZE = (160, 90)
_RIG: dict[str, Any] = {
    "image_size": list(_SIZE),
    "rig": {
        "sensors": [
            {"id": "CAM", "kind": "semantic", "pose": {"x": 1.5, "z": 1.6}},
            {"id": "IMU", "kind": "imu", "pose": {"x": 1.5, "z": 1.6}},
        ]
    },
}


class _Ticked(NamedTuple):
    """What a run of the program came to.

    Attributes:
        ticks_per_s: of the program.
        server_cpu_ms: of the server, for each of its ticks.
        last_frame: the last that the program asked for.
    """

    ticks_per_s: float
    server_cpu_ms: float
    last_frame: int


def _attached() -> dict[str, dict[str, str]]:
    """Attributes of the sensors that the recorder attaches, by blueprint."""
    asked, _ = settings_of(_RIG, ())
    sensors = plan_sensors(config_of(asked))
    return {sensor.blueprint: dict(sensor.attributes) for sensor in sensors}


def _ticked(ticks: int, beside: Callable[[int], object]) -> _Ticked:
    """Let the program tick a new server.

    Args:
        ticks: once sensors are attached.
        beside: is called with the server's port, and comes back when the ego is gone.
    """
    with started_server(("--map", "Stage01")) as server:
        simulator = psutil.Process(server.pid)
        before_s = _cpu_s(simulator)
        clients = [_HOST, str(server.port)]
        command = [sys.executable, str(_CLIENTS / "ticking_program.py"), *clients, str(ticks), "1"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE)
        try:
            beside(server.port)
            output, _ = process.communicate(timeout=_TIMEOUT_S)
        finally:
            process.kill()
            process.communicate()
        if process.returncode:
            raise RuntimeError(f"the program that ticks ended with {process.returncode}")
        said = json.loads(output)
        used_s = _cpu_s(simulator) - before_s
    frames = said["last_frame"] - said["first_frame"] + 1
    server_cpu_ms = used_s / frames * 1000.0
    return _Ticked(float(said["ticks_per_s"]), server_cpu_ms, int(said["last_frame"]))


def _cpu_s(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def _dropped(ticks: int) -> _Ticked:
    """Tick beside a client that drops everything."""

    def beside(port: int) -> None:
        command = [sys.executable, str(_CLIENTS / "dropping_client.py"), _HOST, str(port)]
        subprocess.run([*command, json.dumps(_attached())], check=True, timeout=_TIMEOUT_S)

    return _ticked(ticks, beside)


def _recorded(ticks: int, out: Path) -> tuple[_Ticked, int, int]:
    """Tick beside the recorder; also: frames that were to come, frames that are whole."""
    ticked = _ticked(
        ticks, lambda port: record_beside(f"{_HOST}:{port}", "hero", _RIG, out, episodes=1)
    )
    (episode,) = Dataset(out).episodes
    rows = episode.ledger().to_pylist()
    states = [name for name in rows[0] if name.endswith(".state")]
    whole = sum(all(row[name] == "ok" for name in states) for row in rows)
    if not validate(out).ok:
        whole = 0
    return ticked, ticked.last_frame - rows[0]["server_frame"] + 1, whole


def measure_recording_beside(
    ticks: int = TICKS,
    rounds: int = ROUNDS,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Let the program tick beside the recorder, and beside who drops everything, in turn.

    Args:
        ticks: of each run of the program, once sensors are attached.
        rounds: runs of each kind.
        progress: called with the runs done and their total number.
    """
    ratios, cpu_ratios, expected, whole, fastest = [], [], 0, 0, 0.0
    with tempfile.TemporaryDirectory(prefix="carstage-beside-") as scratch:
        for number in range(rounds):
            dropped = _dropped(ticks)
            progress(2 * number + 1, 2 * rounds)
            recorded, frames, complete = _recorded(ticks, Path(scratch) / str(number))
            progress(2 * number + 2, 2 * rounds)
            ratios.append(dropped.ticks_per_s / recorded.ticks_per_s)
            cpu_ratios.append(recorded.server_cpu_ms / dropped.server_cpu_ms)
            expected, whole = expected + frames, whole + complete
            fastest = max(fastest, recorded.ticks_per_s)
    return Verdict(
        "recording-beside",
        (
            Figure("frames_until_the_ego_went", expected, ">=", rounds * ticks * 9 // 10),
            Figure("frames_lost", expected - whole, "==", 0),
            Figure("ticks_per_s_at_best", fastest),
            Figure("time_over_a_dropping_client", median(ratios), "<=", TARGET_RATIO),
            Figure("server_cpu_over_a_dropping_client", median(cpu_ratios), "<=", TARGET_RATIO),
        ),
        [f"{len(os.sched_getaffinity(0))} cores; ratios {', '.join(f'{r:.3f}' for r in ratios)}"],
    )
