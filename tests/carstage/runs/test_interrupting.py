"""Ctrl-C, kills and what comes after, with the real command, client and simulator."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from driving import (
    TESTED,
    Command,
    attempts,
    carstage,
    children_that_live,
    command,
    events,
    hashes,
    status,
    wait_for,
    wait_for_event,
)

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("interrupting")]


MOMENTS: dict[str, Callable[[Path], object]] = {
    "at the start": lambda out: wait_for_event(out, "run_started"),
    "in mid-episode": lambda out: wait_for_event(out, "tick", tick=5),
}


@pytest.mark.parametrize("moment", MOMENTS.values(), ids=MOMENTS.keys())
def test_ctrl_c_gives_everything_back(
    moment: Callable[[Path], object], small: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    with command(["run", small, "--out", str(out), *TESTED], home) as running:
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
    arguments = ["run", small, "--out", str(out), "--set", "episodes=3", "--json"]
    with command(arguments, home) as running:
        wait_for_event(out, "episode_committed")
        running.press_ctrl_c()
        ended = running.end()
    assert ended.code == 130, ended.stderr
    first = hashes(out)
    done = len(first)  # on a slow machine the second was recorded before the first was committed
    assert done in (1, 2)
    assert f"{done} of 3 episodes are in the dataset" in ended.stderr
    ended = carstage(arguments, home)
    assert ended.code == 0, ended.stderr
    result = json.loads(ended.stdout.splitlines()[-1])
    expected = {"total": 3, "committed": 3 - done, "skipped": done, "failed": 0}
    assert result["episodes"] == expected
    assert first.items() <= hashes(out).items()


#: The command with no time to convert anything once it is interrupted.
NO_TIME = [
    "-c",
    "import sys, carstage.runs.commit_queue as queue; queue._COMMIT_S = float('inf');"
    "from carstage.cli import main; sys.exit(main())",
]


@pytest.fixture(scope="module")
def two(small: str, home: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The hashes of two episodes that were recorded without any interruption."""
    out = tmp_path_factory.mktemp("two") / "dataset"
    ended = carstage(["run", small, "--out", str(out), "--set", "episodes=2"], home)
    assert ended.code == 0, ended.stderr
    return hashes(out)


@pytest.mark.parametrize("mode", ["streaming", "deferred"])
def test_what_is_wholly_recorded_is_committed_first(
    mode: str, small: str, home: Path, tmp_path: Path, two: dict[str, Any]
) -> None:
    out = tmp_path / "dataset"
    arguments = ["run", small, "--out", str(out), "--set", "episodes=2"]
    arguments += ["--set", f"conversion.mode={mode}"]
    with command(arguments, home) as running:
        wait_for_event(out, "episode_recorded")
        running.press_ctrl_c()
        ended = running.end()
    assert ended.code == 130, ended.stderr
    done = hashes(out)
    assert len(done) == 1
    assert done.items() <= two.items()
    assert [name.partition("/")[0] for name in attempts(out)] == list(done)
    assert list((out / "runs").glob("*/raw/*/*")) == []


@pytest.mark.parametrize(
    ("mode", "end"),
    [("streaming", "interrupted"), ("deferred", "interrupted"), ("deferred", "killed")],
)
def test_what_cannot_be_converted_in_time_waits_for_the_next_run(
    mode: str, end: str, small: str, home: Path, tmp_path: Path, two: dict[str, Any]
) -> None:
    out = tmp_path / "dataset"
    arguments = ["run", small, "--out", str(out), "--set", "episodes=2"]
    arguments += ["--set", f"conversion.mode={mode}"]
    with command(arguments, home, NO_TIME) as running:
        recorded = wait_for_event(out, "episode_recorded")["episode_id"]
        if end == "interrupted":
            running.press_ctrl_c()
            ended = running.end()
            assert ended.code == 130, ended.stderr
            assert "the next run of the same command does it" in ended.stderr
        else:
            wait_for(lambda: len(reserved(out)) == 2, "the second episode")
            running.process.kill()
            running.end()
    wait_for(lambda: children_that_live(out) == [], "the end of the children")
    assert hashes(out) == {}
    found = carstage(["doctor", "--out", str(out), "--json"], home)
    assert f"episode {recorded} is recorded and waits" in found.stdout
    ended = carstage(arguments, home)
    assert ended.code == 0, ended.stderr
    assert f"Episode {recorded} is recorded already" in ended.stderr
    started = [event["episode_id"] for event in events(out) if event["event"] == "episode_started"]
    assert started
    assert recorded not in started
    assert hashes(out) == two
    assert len(attempts(out)) == 2
    assert list((out / "runs").glob("*/raw/*/*")) == []


def reserved(out: Path) -> list[str]:
    return [event["episode_id"] for event in events(out) if event["event"] == "attempt_reserved"]


def press_twice(running: Command) -> int:
    running.press_ctrl_c()
    os.killpg(running.process.pid, signal.SIGTERM)  # two of one kind at once are one signal
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
