"""Runs with several workers: the real command, client and simulators."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from driving import (
    SMALL,
    attempts,
    carstage,
    children_that_live,
    command,
    differing,
    events,
    hashes,
    status,
    wait_for,
    wait_for_event,
)

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("runs")]

END_S = 10.0
SLACK_S = 3.0
"""Of a machine that others use: for the end of the command's own process."""


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("config") / "three.yaml"
    text = SMALL.replace("duration_s: 2", "duration_s: 1\nepisodes: 3")
    path.write_text(text)
    return str(path)


@pytest.fixture(scope="module")
def one_worker(tmp_path_factory: pytest.TempPathFactory, three: str, home: Path) -> Path:
    out = tmp_path_factory.mktemp("one") / "dataset"
    ended = carstage(["run", three, "--out", str(out)], home)
    assert ended.code == 0, ended.stderr
    return out


def workers(out: Path) -> dict[int, int]:
    """Process ids of a run's workers by number; of one that was replaced, the newest."""
    started = [event for event in events(out) if event["event"] == "worker_started"]
    return {event["worker"]: event["pid"] for event in started}


def nothing_is_left(out: Path) -> None:
    """No process, and no file of an attempt that is no episode."""
    run_id = status(out)["run_id"]
    left = []
    for process in psutil.process_iter():
        try:
            mine = process.environ().get("CARSTAGE_RUN_ID") == run_id
        except psutil.Error:
            continue
        if mine and process.status() != psutil.STATUS_ZOMBIE:
            left.append(process.cmdline())
    assert left == []
    assert children_that_live(out) == []
    assert [name.split("/")[0] for name in attempts(out)] == sorted(hashes(out))
    assert list((out / "runs").glob("*/raw")) == []


def test_bytes_do_not_depend_on_the_number_of_workers(
    one_worker: Path, three: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    ended = carstage(["run", three, "--out", str(out), "--workers", "2", "--json"], home)
    assert ended.code == 0, ended.stderr
    result = json.loads(ended.stdout.splitlines()[-1])
    assert result["episodes"] == {"total": 3, "committed": 3, "skipped": 0, "failed": 0}
    assert result["frames"] == 30
    assert len(hashes(out)) == 3
    assert differing(out, one_worker) == []
    nothing_is_left(out)
    told = events(out)
    assert {e["worker"] for e in told if e["event"] == "server_started"} == {1, 2}
    assert len({e["port"] for e in told if e["event"] == "server_started"}) == 2
    assert told[-1]["event"] == "run_finished"
    assert status(out)["workers"] == []
    again = carstage(["run", three, "--out", str(out), "--workers", "2", "--json"], home)
    assert json.loads(again.stdout.splitlines()[-1])["episodes"]["skipped"] == 3


def test_episodes_of_killed_workers_and_servers_are_recorded_again(
    one_worker: Path, three: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    with command(["run", three, "--out", str(out), "--workers", "2", "--json"], home) as running:
        first = wait_for_event(out, "tick")
        os.kill(workers(out)[first["worker"]], signal.SIGKILL)
        lost = wait_for_event(out, "worker_lost")
        assert lost["worker"] == first["worker"]

        def server_of_another() -> list[dict[str, Any]]:
            return [
                event
                for event in events(out)
                if event["event"] == "server_started" and event["time"] > lost["time"]
            ]

        restarted = wait_for(server_of_another, "the server of the new worker")
        os.kill(restarted[0]["pid"], signal.SIGKILL)
        ended = running.end()
    assert ended.code == 0, ended.stderr
    assert "signal 9" in ended.stderr
    assert len(hashes(out)) == 3
    assert differing(out, one_worker) == []
    assert "episode_retried" in [event["event"] for event in events(out)]
    nothing_is_left(out)


def test_an_episode_whose_workers_die_is_given_up_after_its_retries(
    three: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    settings = ["--set", "episodes=1", "--set", "duration_s=600", "--retries", "0", "--json"]
    with command(["run", three, "--out", str(out), "--workers", "2", *settings], home) as running:
        wait_for_event(out, "tick")
        os.kill(workers(out)[1], signal.SIGKILL)
        ended = running.end()
    assert ended.code == 1, ended.stderr
    (reason,) = json.loads(ended.stdout.splitlines()[-1])["failures"].values()
    assert "Worker 1 is gone: signal 9" in reason
    assert attempts(out) == []
    nothing_is_left(out)


@pytest.mark.parametrize("moment", ["worker_started", "tick"])
def test_ctrl_c_ends_all_workers_in_time_and_the_same_command_goes_on(
    moment: str, one_worker: Path, three: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    arguments = ["run", three, "--out", str(out), "--workers", "2", "--json"]
    with command(arguments, home) as running:
        wait_for_event(out, moment)
        begin_s = time.monotonic()
        running.press_ctrl_c()
        ended = running.end()
        assert time.monotonic() - begin_s < END_S + SLACK_S
    assert ended.code == 130, ended.stderr
    assert "Traceback" not in ended.stderr
    assert status(out)["state"] == "interrupted"
    assert children_that_live(out) == []
    ended = carstage(arguments, home)
    assert ended.code == 0, ended.stderr
    assert differing(out, one_worker) == []
    nothing_is_left(out)


def test_workers_end_with_their_run_and_the_next_one_clears_up(
    one_worker: Path, three: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    arguments = ["run", three, "--out", str(out), "--workers", "2"]
    with command(arguments, home) as running:
        wait_for_event(out, "tick")
        running.process.kill()
        running.process.communicate()
    ended = carstage(arguments, home)
    assert ended.code == 0, ended.stderr
    assert "Removed what the dead run" in ended.stderr
    assert differing(out, one_worker) == []
    nothing_is_left(out)


def test_deferred_recordings_are_converted_by_the_worker_that_made_them(
    one_worker: Path, three: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    settings = ["--workers", "2", "--set", "conversion.mode=deferred"]
    ended = carstage(["run", three, "--out", str(out), *settings], home)
    assert ended.code == 0, ended.stderr
    assert differing(out, one_worker) == []
    nothing_is_left(out)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["--workers", "0"], "'0' is not a number of workers"),
        (["--workers", "many"], "'many' is not a number of workers"),
        (
            ["--workers", "2", "--set", "server={kind: remote, host: 127.0.0.1, port: 1}"],
            "workers need a server each",
        ),
        (["--workers", "200", "--set", "server.port=65000"], "need the ports 65000 to 65599"),
    ],
)
def test_workers_that_cannot_be_are_refused_before_anything_starts(
    settings: list[str], message: str, three: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    ended = carstage(["run", three, "--out", str(out), *settings], home)
    assert ended.code == 2, ended.stderr
    assert message in ended.stderr
    assert not out.exists()
