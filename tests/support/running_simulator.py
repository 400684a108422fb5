"""The simulator as a process of its own, on free ports."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

_READY = re.compile(r"carstage_sim ready rpc=(?P<host>[\d.]+):(?P<port>\d+) streaming=(?P<s>\d+)")
_STOP_TIMEOUT_S = 10.0


@dataclass(frozen=True)
class RunningSimulator:
    """A simulator that runs as a process of its own."""

    host: str
    port: int
    streaming_port: int
    process: subprocess.Popen[str]


def start_simulator(log: Path, *arguments: str) -> RunningSimulator:
    """Start ``python -m carstage_sim`` on free ports and wait for its ready line.

    Recordings lie beside the log.
    """
    command = [sys.executable, "-m", "carstage_sim", "--port", "0", "--threads", "1"]
    command += ["--recordings", str(log.parent / "recordings"), *arguments]
    with log.open("w") as stderr:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, text=True)
    assert process.stdout is not None
    line = process.stdout.readline()  # a server that dies closes the pipe
    match = _READY.match(line)
    if match is None:
        with process:  # which closes the pipe
            process.kill()
        raise RuntimeError(f"no ready line but {line!r}:\n{log.read_text()[-4000:]}")
    return RunningSimulator(match["host"], int(match["port"]), int(match["s"]), process)


def stop_simulator(simulator: RunningSimulator) -> int:
    """End a simulator and return its exit status."""
    simulator.process.terminate()
    try:
        status = simulator.process.wait(_STOP_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        simulator.process.kill()
        status = simulator.process.wait()
    assert simulator.process.stdout is not None
    simulator.process.stdout.close()
    return status
