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
import threading
from collections.abc import Callable
from contextlib import suppress
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
_END_S = 20.0
_ENCLOSING = ("begin", "end")
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
        server_cpu_ms: of the server, for each tick that counts.
        beside_cpu_ms: of who is beside the program, likewise.
        last_frame: the last that the program asked for.
    """

    ticks_per_s: float
    server_cpu_ms: float
    beside_cpu_ms: float
    last_frame: int


class _Meter:
    """CPU time while the ticks go on that count; reads what the program writes meanwhile.

    Args:
        server: its process.
        program: that ticks; its standard error is read.
    """

    def __init__(self, server: psutil.Process, program: subprocess.Popen[str]) -> None:
        self._server = server
        self._program = program
        self._at: dict[str, tuple[float, float]] = {}
        self._thread = threading.Thread(target=self._read, name="meter", daemon=True)
        self._thread.start()

    def used_s(self) -> tuple[float, float]:
        """Of the server, and of who is beside the program; the program has ended.

        Raises:
            RuntimeError: the program did not come so far.
        """
        self._thread.join(_END_S)
        if len(self._at) < len(_ENCLOSING):
            raise RuntimeError("the program did not tick so often")
        (server_s, beside_s), (before_s, beside_before_s) = self._at["end"], self._at["begin"]
        return server_s - before_s, beside_s - beside_before_s

    def _read(self) -> None:
        assert self._program.stderr is not None
        for line in self._program.stderr:
            if line.strip() in _ENCLOSING:
                self._at[line.strip()] = _cpu_s(self._server), self._beside_s()
            else:
                sys.stderr.write(line)

    def _beside_s(self) -> float:
        """Of this process and its children, but for the server and the program."""
        here = psutil.Process()
        apart = {self._server.pid, self._program.pid}
        beside_s = _cpu_s(here)
        for one in here.children(recursive=True):
            with suppress(psutil.NoSuchProcess):
                beside_s += 0.0 if one.pid in apart else _cpu_s(one)
        return beside_s


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
        clients = [_HOST, str(server.port)]
        command = [sys.executable, str(_CLIENTS / "ticking_program.py"), *clients, str(ticks), "1"]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            meter = _Meter(psutil.Process(server.pid), process)
            assert process.stdout is not None
            try:
                beside(server.port)
                output = process.stdout.read()  # a line; the server's clients have time-outs
                process.wait(_TIMEOUT_S)
                server_s, beside_s = meter.used_s()
            finally:
                process.kill()
        if process.returncode:
            raise RuntimeError(f"the program that ticks ended with {process.returncode}")
    said = json.loads(output)
    per_tick = 1000.0 / ticks
    return _Ticked(
        float(said["ticks_per_s"]),
        server_s * per_tick,
        beside_s * per_tick,
        int(said["last_frame"]),
    )


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
    pairs: list[tuple[_Ticked, _Ticked]] = []
    expected, whole = 0, 0
    with tempfile.TemporaryDirectory(prefix="carstage-beside-") as scratch:
        for number in range(rounds):
            dropped = _dropped(ticks)
            progress(2 * number + 1, 2 * rounds)
            recorded, frames, complete = _recorded(ticks, Path(scratch) / str(number))
            progress(2 * number + 2, 2 * rounds)
            pairs.append((dropped, recorded))
            expected, whole = expected + frames, whole + complete
    ratios = [dropped.ticks_per_s / recorded.ticks_per_s for dropped, recorded in pairs]
    server = median(recorded.server_cpu_ms / dropped.server_cpu_ms for dropped, recorded in pairs)
    return Verdict(
        "recording-beside",
        (
            Figure("frames_until_the_ego_went", expected, ">=", rounds * ticks * 9 // 10),
            Figure("frames_lost", expected - whole, "==", 0),
            Figure("ticks_per_s_at_best", max(each.ticks_per_s for _, each in pairs)),
            Figure("time_over_a_dropping_client", median(ratios), "<=", TARGET_RATIO),
            Figure("server_cpu_over_a_dropping_client", server, "<=", TARGET_RATIO),
            Figure("recorder_cpu_ms", median(each.beside_cpu_ms for _, each in pairs)),
            Figure("dropping_client_cpu_ms", median(each.beside_cpu_ms for each, _ in pairs)),
        ),
        [f"{len(os.sched_getaffinity(0))} cores; ratios {', '.join(f'{r:.3f}' for r in ratios)}"],
    )
