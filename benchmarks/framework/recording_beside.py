"""``carstage record`` beside a program that ticks as fast as it can: what is lost, what it costs.

The program runs beside the recorder, and again beside a client that attaches the same sensors and
drops their data. Both are done in turn, each time on a new server.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.simulator.server_process import running_server
from carstage import Dataset, validate
from carstage.bench.verdict import Figure, Verdict
from carstage.runs import record_beside

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
_DROPPED = {
    "sensor.camera.semantic_segmentation": {
        "image_size_x": str(_SIZE[0]),
        "image_size_y": str(_SIZE[1]),
    },
    "sensor.other.imu": {},
}


@contextmanager
def _ticking(port: int, ticks: int) -> Iterator[dict[str, Any]]:
    """Run the program; the mapping gets what it says at its end."""
    command = [sys.executable, str(_CLIENTS / "ticking_program.py"), _HOST, str(port), str(ticks)]
    process = subprocess.Popen([*command, "1"], stdout=subprocess.PIPE)
    said: dict[str, Any] = {}
    try:
        yield said
        output, _ = process.communicate(timeout=_TIMEOUT_S)
        if process.returncode:
            raise RuntimeError(f"the program that ticks ended with {process.returncode}")
        said.update(json.loads(output))
    finally:
        process.kill()
        process.communicate()


def _dropped(ticks: int) -> float:
    """Ticks per second beside a client that drops everything."""
    with running_server(("--map", "Stage01")) as port, _ticking(port, ticks) as said:
        command = [sys.executable, str(_CLIENTS / "dropping_client.py"), _HOST, str(port)]
        subprocess.run([*command, json.dumps(_DROPPED)], check=True, timeout=_TIMEOUT_S)
    return float(said["ticks_per_s"])


def _recorded(ticks: int, out: Path) -> tuple[float, int, int]:
    """Ticks per second beside the recorder, frames that were to come, frames that are whole."""
    with running_server(("--map", "Stage01")) as port, _ticking(port, ticks) as said:
        record_beside(f"{_HOST}:{port}", "hero", _RIG, out, episodes=1)
    (episode,) = Dataset(out).episodes
    rows = episode.ledger().to_pylist()
    states = [name for name in rows[0] if name.endswith(".state")]
    whole = sum(all(row[name] == "ok" for name in states) for row in rows)
    if not validate(out).ok:
        whole = 0
    return float(said["ticks_per_s"]), int(said["last_frame"]) - rows[0]["server_frame"] + 1, whole


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
    ratios, expected, whole, fastest = [], 0, 0, 0.0
    with tempfile.TemporaryDirectory(prefix="carstage-beside-") as scratch:
        for number in range(rounds):
            dropped = _dropped(ticks)
            progress(2 * number + 1, 2 * rounds)
            recorded, frames, complete = _recorded(ticks, Path(scratch) / str(number))
            progress(2 * number + 2, 2 * rounds)
            ratios.append(dropped / recorded)
            expected, whole = expected + frames, whole + complete
            fastest = max(fastest, recorded)
    return Verdict(
        "recording-beside",
        (
            Figure("frames_until_the_ego_went", expected, ">=", rounds * ticks * 9 // 10),
            Figure("frames_lost", expected - whole, "==", 0),
            Figure("ticks_per_s_at_best", fastest),
            Figure("time_over_a_dropping_client", median(ratios), "<=", TARGET_RATIO),
        ),
        [f"{len(os.sched_getaffinity(0))} cores; ratios {', '.join(f'{r:.3f}' for r in ratios)}"],
    )
