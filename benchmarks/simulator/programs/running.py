"""Runs one program as a process of its own, ends it, and says what became of it."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from time import monotonic
from typing import IO, Literal

from benchmarks.simulator.programs.catalogue import MOST_SECONDS, Program

Result = Literal["passed", "failed", "not run"]

PORT = 2000
"""Where CARLA's examples look for a server; many have it in their text."""

_END_S = 120.0
_LOOK_S = 90.0
_LAST_LINES = 400
_RAISED = re.compile(r"^([A-Za-z_][\w.]*(?:Error|Exception|Interrupt|Empty|Exit))\b:?\s*(.*)$")
_MISSING = re.compile(r"No module named '([\w.]+)'")
_NEWER = re.compile(r"module 'carla(?:\.\w+)*' has no attribute '(\w+)'")
_WHEELS_ABORT = "terminate called without an active exception"
"""How the client wheel ends some processes after their work is done."""

_ACTORS = """
import json, sys, carla
client = carla.Client("127.0.0.1", int(sys.argv[1]))
client.set_timeout(30.0)
world = client.get_world()
try:
    world.wait_for_tick(30.0)  # before the first frame a client knows of nobody
except RuntimeError:
    pass
print(json.dumps([actor.type_id for actor in world.get_actors()]))
"""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a program, or of a case of the smoke tests.

    Attributes:
        name: its path with its arguments, or the case.
        reason: what ended it; why it failed or was not run.
        seconds: how long it ran.
    """

    name: str
    result: Result
    reason: str
    seconds: float = 0.0


def environment_for(folder: Path, home: Path) -> dict[str, str]:
    """Variables of a program: no window, no sound, CARLA's agents within reach.

    Args:
        folder: CARLA's ``PythonAPI``.
        home: an empty folder, as the client keeps files in its user's home.
    """
    found = [str(folder / "carla"), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    return {
        **os.environ,
        "HOME": str(home),
        "PYTHONPATH": os.pathsep.join(filter(None, found)),
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONUNBUFFERED": "1",
        "SDL_VIDEODRIVER": "dummy",
        "SDL_AUDIODRIVER": "dummy",
        "MPLBACKEND": "Agg",
    }


@dataclass(frozen=True, slots=True)
class Runner:
    """Runs programs of a folder with one interpreter.

    Attributes:
        folder: CARLA's ``PythonAPI``.
        python: interpreter with the client wheel.
        seconds: how long a program runs that ends only when it is interrupted.
    """

    folder: Path
    python: str = sys.executable
    seconds: float = 20.0

    def run(self, program: Program, scratch: Path) -> Outcome:
        """Run a program against the server on :data:`PORT`.

        Args:
            program: what is run; nothing of its file is changed.
            scratch: folder in which it runs and that its files go to.
        """
        for name, text in program.files:
            (scratch / name).write_text(text, "utf-8")
        command = [self.python, str(self.folder / program.path), *program.arguments]
        environment = environment_for(self.folder, scratch)
        begin_s = monotonic()
        with (scratch / "output.log").open("w+b") as output:
            process = started(command, scratch, environment, output)
            try:
                reason = self._follow(program, process, scratch)
            finally:
                end_group(process)
            seconds = monotonic() - begin_s
            text = last_text(output)
        reason = reason or judge(process.returncode, text, interrupted=program.interrupt)
        if missing := lacking(last_exception(text)):
            return Outcome(program.name, "not run", missing, seconds)
        if reason:
            return Outcome(program.name, "failed", reason, seconds)
        ran_on = program.interrupt and seconds >= (program.seconds or self.seconds)
        return Outcome(
            program.name, "passed", "until interrupted" if ran_on else "to its end", seconds
        )

    def _follow(self, program: Program, process: subprocess.Popen[bytes], scratch: Path) -> str:
        """Wait for its end, or interrupt it; says what is wrong, if anything."""
        if not program.interrupt:
            limit_s = program.seconds or MOST_SECONDS
            return "" if _waited(process, limit_s) else f"did not end within {limit_s:.0f} s"
        if _waited(process, program.seconds or self.seconds):
            return "ended by itself" if program.actors and process.returncode == 0 else ""
        absent = self._absent(program, scratch)
        process.send_signal(signal.SIGINT)
        if not _waited(process, _END_S):
            return f"did not end within {_END_S:.0f} s of Ctrl-C"
        return absent

    def _absent(self, program: Program, scratch: Path) -> str:
        """Which of the actors that the program makes the world lacks."""
        if not program.actors:
            return ""
        try:
            listed = subprocess.run(
                [self.python, "-c", _ACTORS, str(PORT)],
                cwd=scratch,
                env=environment_for(self.folder, scratch),
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                timeout=_LOOK_S,
                check=True,
            )
        except (subprocess.TimeoutExpired, subprocess.CalledProcessError):
            return "the server did not tell its actors"
        return too_few(program.actors, json.loads(listed.stdout))


def too_few(wanted: Sequence[tuple[str, int]], types: Sequence[str]) -> str:
    """Says of which pattern there are fewer actors than wanted, if of any."""
    for pattern, least in wanted:
        found = sum(fnmatch(name, pattern) for name in types)
        if found < least:
            return f"{found} actors of {pattern} after its time, at least {least} were expected"
    return ""


def judge(status: int, text: str, *, interrupted: bool) -> str:
    """What is wrong with the way a program ended; empty when nothing is.

    Args:
        status: exit status, negative for a signal.
        text: what it printed last.
        interrupted: it got Ctrl-C, so that it may end by that.
    """
    raised = last_exception(text)
    if raised and not (interrupted and raised.startswith("KeyboardInterrupt")):
        return raised
    if status == 0 or (status == -signal.SIGABRT and _WHEELS_ABORT in text):
        return ""
    if interrupted and (status in (1, 130, -signal.SIGINT)):
        return ""
    lines = text.strip().splitlines()
    return f"exit status {status}" + (f": {lines[-1][:200]}" if lines else "")


def last_exception(text: str) -> str:
    """The line that names the exception of the last traceback; empty when there is none."""
    _, found, after = text.rpartition("Traceback (most recent call last)")
    if not found:
        return ""
    named = [line for line in after.splitlines() if _RAISED.match(line.strip())]
    return named[-1].strip()[:300] if named else "a traceback without an exception's name"


def lacking(raised: str) -> str:
    """What a program needs and this machine does not have; empty where it is something else.

    Args:
        raised: the exception that ended it, with its name.
    """
    if found := _MISSING.search(raised):
        return f"needs the package {found[1].partition('.')[0]}"
    if found := _NEWER.search(raised):
        return f"needs a newer client, with carla.{found[1]}"
    if raised.startswith("Boost.Python.ArgumentError"):
        return "needs a newer client, whose calls take other arguments"
    return ""


def started(
    command: Sequence[str], cwd: Path, environment: Mapping[str, str], output: IO[bytes]
) -> subprocess.Popen[bytes]:
    """Start a program in a process group of its own, its output in a file."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # of a shell's background job
        signal.signal(signal.SIGINT, signal.default_int_handler)  # or it would ignore Ctrl-C, too
    return subprocess.Popen(
        command,
        cwd=cwd,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )


def end_group(process: subprocess.Popen[bytes]) -> None:
    """End what is left of a program and of the processes that it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def last_text(output: IO[bytes]) -> str:
    """The last lines of a program's output."""
    output.seek(0)
    return "\n".join(output.read().decode("utf-8", "replace").splitlines()[-_LAST_LINES:])


def _waited(process: subprocess.Popen[bytes], seconds: float) -> bool:
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return False
    return True
