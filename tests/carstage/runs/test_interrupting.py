"""Ctrl-C, kills and what comes after, with the real command, client and simulator."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from driving import (
    Command,
    attempts,
    carstage,
    children_that_live,
    command,
    hashes,
    status,
    wait_for,
    wait_for_event,
)

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("interrupting")]


MOMENTS: dict[str, Callable[[Path], object]] = {
    "at the start": lambda out: wait_for_event(out, "run_started"),
    "in mid-episode": lambda out: wait_for_event(out, "tick", tick=5),
    "while it converts": lambda out: wait_for_event(out, "episode_recorded"),
}


@pytest.mark.parametrize("moment", MOMENTS.values(), ids=MOMENTS.keys())
def test_ctrl_c_gives_everything_back(
    moment: Callable[[Path], object], small: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    with command(["run", small, "--out", str(out)], home) as running:
        moment(out)
        running.press_ctrl_c()
        ended = running.end()
    assert ended.code == 130, ended.stderr
    assert "same command again" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert children_that_live(out) == []
    assert attempts(out) == []
    assert hashes(out) == {}
    assert status(out)["state"] == "interrupted"
    assert list((out / "runs").glob("*/raw")) == []


def test_interrupted_run_continues_with_the_same_command(
    small: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    arguments = ["run", small, "--out", str(out), "--set", "episodes=2", "--json"]
    with command(arguments, home) as running:
        wait_for_event(out, "episode_committed")
        running.press_ctrl_c()
        ended = running.end()
    assert ended.code == 130, ended.stderr
    assert "1 of 2 episodes are in the dataset" in ended.stderr
    first = hashes(out)
    assert len(first) == 1
    ended = carstage(arguments, home)
    assert ended.code == 0, ended.stderr
    result = json.loads(ended.stdout.splitlines()[-1])
    assert result["episodes"] == {"total": 2, "committed": 1, "skipped": 1, "failed": 0}
    assert first.items() <= hashes(out).items()


def press_twice(running: Command) -> int:
    running.press_ctrl_c()
    threading.Event().wait(0.1)  # two presses at once are one signal
    running.press_ctrl_c()
    return 130


def kill(running: Command) -> int:
    running.process.kill()
    return -signal.SIGKILL


@pytest.mark.parametrize("end", [press_twice, kill])
def test_run_that_ends_at_once_leaves_no_process_and_the_next_run_clears_up(
    end: Callable[[Command], int], small: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    with command(["run", small, "--out", str(out)], home) as running:
        wait_for_event(out, "tick", tick=3)
        code = end(running)
        ended = running.end()
    assert ended.code == code
    assert status(out)["state"] == "recording"
    wait_for(lambda: children_that_live(out) == [], "the end of the children")
    if end is press_twice:
        return  # what comes after is the same
    ended = carstage(["run", small, "--out", str(out), "--set", "duration_s=0.1"], home)
    assert ended.code == 0, ended.stderr
    assert "had left" in ended.stderr
    assert len(attempts(out)) == 1


def test_first_converter_is_deaf_to_ctrl_c_from_its_first_instruction() -> None:
    program = (
        "import os, re, signal\n"
        "from pathlib import Path\n"
        "from carstage.runs.converters import start_pool\n"
        "with start_pool(1, True) as pool:\n"
        "    status = Path(f'/proc/{pool.submit(os.getpid).result()}/status').read_text()\n"
        "blocked = int(re.search(r'SigBlk:\\s*(\\w+)', status).group(1), 16)\n"
        "print(bool(blocked >> (signal.SIGINT - 1) & 1))\n"
    )
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert answer.stdout == "True\n", answer.stderr
