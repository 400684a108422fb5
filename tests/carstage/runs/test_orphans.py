"""A dead run's processes are found by its id and their age; nobody else's are touched."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack

import psutil
import pytest

from carstage.runs.orphans import RUN_VARIABLE, end_orphans, marked, orphans

SLEEPER = [sys.executable, "-c", "import sys; print(flush=True); sys.stdin.read()"]
PARENT = [
    sys.executable,
    "-c",
    "import subprocess, sys; p = subprocess.Popen([sys.executable, '-c', "
    "'import sys; sys.stdin.read()']); print(p.pid, flush=True); sys.stdin.read()",
]


@pytest.fixture
def run_id() -> str:
    """Of no other test, which may look for orphans on this machine at the same moment."""
    return str(uuid.uuid4())


@pytest.fixture
def started() -> Iterator[list[subprocess.Popen[bytes]]]:
    processes: list[subprocess.Popen[bytes]] = []
    yield processes
    for process in processes:
        process.kill()
        process.communicate()


def start(
    started: list[subprocess.Popen[bytes]], command: list[str], run_id: str | None
) -> tuple[int, str]:
    """A process as the run of that id would start it; returns its id and its first line."""
    with ExitStack() as stack:
        if run_id is not None:
            stack.enter_context(marked(run_id))
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    started.append(process)
    assert process.stdout is not None
    return process.pid, process.stdout.readline().decode().strip()


def test_orphans_of_a_run_are_ended_with_what_they_have_started(
    started: list[subprocess.Popen[bytes]], run_id: str
) -> None:
    begun_s = time.time()
    parent, child = start(started, PARENT, run_id)
    other, _ = start(started, SLEEPER, f"{run_id}-other")
    unmarked, _ = start(started, SLEEPER, None)
    assert end_orphans(run_id, begun_s) == sorted([parent, int(child)])
    assert not psutil.pid_exists(parent)
    assert psutil.Process(other).is_running()
    assert psutil.Process(unmarked).is_running()
    assert end_orphans(run_id, begun_s) == []


def test_process_that_is_held_still_is_ended_too(
    started: list[subprocess.Popen[bytes]], run_id: str
) -> None:
    begun_s = time.time()
    pid, _ = start(started, SLEEPER, run_id)
    os.kill(pid, signal.SIGSTOP)
    assert end_orphans(run_id, begun_s) == [pid]


def test_process_older_than_the_run_is_not_the_runs(
    started: list[subprocess.Popen[bytes]], run_id: str
) -> None:
    start(started, SLEEPER, run_id)
    assert orphans(run_id, time.time() + 60.0) == []


def test_mark_ends_with_its_stretch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(RUN_VARIABLE, "outer")
    with marked("inner"):
        assert os.environ[RUN_VARIABLE] == "inner"
    assert os.environ[RUN_VARIABLE] == "outer"
