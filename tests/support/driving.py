"""Runs the real command in a process of its own and watches the folder of its run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

PATIENCE_S = 240.0
"""The first start on a machine compiles the simulator's kernels."""

SMALL = """
name: small
duration_s: 2
fps: 10
vehicles: {count: 6}
pedestrians: {count: 3}
conversion: {workers: 1}
image_size: [96, 54]
server: {self_test: "off"}
rig: {preset: demo}
"""
"""Without the self-test, which takes as long as the rest of such a run; see ``TESTED``."""

TESTED = ["--set", "server.self_test=on"]
"""For the runs that are to be as a user's first one."""


@dataclass(frozen=True)
class Ended:
    """What a command left."""

    code: int
    stdout: str
    stderr: str


class Command:
    """``carstage …`` while it runs, in a process group of its own as a shell would start it."""

    def __init__(self, arguments: list[str], home: Path, program: list[str] | None = None) -> None:
        cache = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))
        # The client writes ~/carlaCache; the compiled kernels stay in the cache of this machine.
        environment = {**os.environ, "HOME": str(home), "XDG_CACHE_HOME": cache}
        self.process = subprocess.Popen(
            [sys.executable, *(program or ["-m", "carstage.cli"]), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
            start_new_session=True,
        )

    def press_ctrl_c(self) -> None:
        """A terminal sends SIGINT to the whole foreground group."""
        os.killpg(self.process.pid, signal.SIGINT)

    def end(self) -> Ended:
        stdout, stderr = self.process.communicate(timeout=PATIENCE_S)
        return Ended(self.process.returncode, stdout, stderr)


@contextmanager
def command(
    arguments: list[str], home: Path, program: list[str] | None = None
) -> Iterator[Command]:
    """Start a command; ``program``: what Python runs instead of ``-m carstage.cli``."""
    running = Command(arguments, home, program)
    try:
        yield running
    finally:
        if running.process.poll() is None:
            os.killpg(running.process.pid, signal.SIGKILL)
            running.process.communicate()


def carstage(arguments: list[str], home: Path) -> Ended:
    """Run a command to its end."""
    with command(arguments, home) as running:
        return running.end()


def events(out: Path, number: int = -1) -> list[dict[str, Any]]:
    """The events of a dataset's newest run (or another one); a last line may still be written."""
    files = sorted((out / "runs").glob("*/events.jsonl"))
    if not files:
        return []
    lines = files[number].read_text("utf-8").split("\n")[:-1]
    return [json.loads(line) for line in lines]


def wait_for(condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> Any:
    """Poll until the condition gives something."""
    deadline_s = time.monotonic() + patience_s
    pause = threading.Event()
    while time.monotonic() < deadline_s:
        found = condition()
        if found:
            return found
        pause.wait(0.02)
    raise AssertionError(f"waited in vain for {what}")


def wait_for_event(out: Path, name: str, **fields: Any) -> dict[str, Any]:
    """Wait until the newest run has an event with these fields at least that large."""

    def seen() -> dict[str, Any] | None:
        for event in events(out):
            if event["event"] == name and all(event[k] >= v for k, v in fields.items()):
                return event
        return None

    found: dict[str, Any] = wait_for(seen, f"event {name} {fields}")
    return found


def children_that_live(out: Path) -> list[int]:
    """Processes that the runs of a dataset have started and that are still there."""
    pids = set()
    for number in range(len(list((out / "runs").glob("*/events.jsonl")))):
        pids |= {e["pid"] for e in events(out, number) if isinstance(e.get("pid"), int)}
    return [pid for pid in pids if psutil.pid_exists(pid) and _is_ours(pid)]


def _is_ours(pid: int) -> bool:
    try:
        process = psutil.Process(pid)
        return process.status() != psutil.STATUS_ZOMBIE and "carstage" in " ".join(
            process.cmdline()
        )
    except psutil.Error:
        return False


def hashes(out: Path) -> dict[str, dict[str, str]]:
    """Hash by path for each committed episode."""
    found = {}
    for path in sorted((out / "commits").glob("*.json")):
        marker = json.loads(path.read_bytes())
        found[path.stem] = {entry["path"]: entry["hash"] for entry in marker["files"]}
    return found


def differing(out: Path, other: Path) -> list[str]:
    """Files, as ``<episode>/<path>``, that two datasets do not have in common, byte for byte."""
    mine, theirs = (
        {
            f"{episode}/{path}": digest
            for episode, files in found.items()
            for path, digest in files.items()
        }
        for found in (hashes(out), hashes(other))
    )
    return sorted(path for path in {*mine, *theirs} if mine.get(path) != theirs.get(path))


def attempts(out: Path) -> list[str]:
    """All attempts whose folder exists, as ``<episode>/<attempt>``."""
    return sorted(str(p.relative_to(out / "episodes")) for p in (out / "episodes").glob("*/*"))


def status(out: Path) -> dict[str, Any]:
    """The newest run's status."""
    newest = sorted((out / "runs").glob("*/status.json"))[-1]
    document: dict[str, Any] = json.loads(newest.read_bytes())
    return document
