"""A program that ticks a server while it is recorded: it knows nothing of who records it."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from carstage.runs.events import OtherEvent, RunEvent
from running_simulator import RunningSimulator

PROGRAM = Path(__file__).parents[2] / "benchmarks/framework/clients/ticking_program.py"
_END_S = 120.0


class TickingProgram:
    """The program, and what it said.

    Attributes:
        last_frames: the last frame of each life of its ego, once it has ended.
    """

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self._process = process
        self._recorded = set[str]()
        self.last_frames: list[int] = []

    def on_event(self, event: RunEvent) -> None:
        """Let it go on when the first frame of a life is recorded.

        A recorder that waits for a processor between attaching its sensors and listening to them
        may do so for seconds. A program that went on by the clock would be over meanwhile.
        """
        if not isinstance(event, OtherEvent) or event.name != "tick":
            return
        recording = str(event.fields["episode_id"])
        if recording not in self._recorded:
            self._recorded.add(recording)
            assert self._process.stdin is not None
            with suppress(BrokenPipeError):
                self._process.stdin.write(b"\n")
                self._process.stdin.flush()

    def end(self) -> None:
        """Wait until it has ended well."""
        output, _ = self._process.communicate(timeout=_END_S)
        assert self._process.returncode == 0
        self.last_frames += [json.loads(line)["last_frame"] for line in output.splitlines()]


@contextmanager
def ticking(
    simulator: RunningSimulator,
    ticks: int,
    lives: int = 1,
    *,
    by_events: bool = True,
    to_the_end: bool = True,
    python: str = sys.executable,
) -> Iterator[TickingProgram]:
    """Run the program while the block runs.

    Args:
        simulator: what it ticks.
        ticks: of each life of its ego, once that is recorded.
        lives: how many.
        by_events: whether ``on_event`` lets it go on; otherwise two seconds do.
        to_the_end: whether it is waited for; otherwise it is killed when the block ends.
        python: interpreter with the client's wheel.
    """
    command = [python, str(PROGRAM), simulator.host, str(simulator.port), str(ticks), str(lives)]
    if by_events:
        command.append("input")
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    program = TickingProgram(process)
    try:
        yield program
        if to_the_end:
            program.end()
    finally:
        process.kill()
        process.communicate()
