"""Whole runs: the real command, the real client, the embedded simulator.

What a killed collector, converter or server may change is judged by the campaign of faults, see
tests/carstage/bench/test_faults.py.
"""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import pytest

from carstage.rawlog.reader import EpisodeLog
from carstage.server import EmbeddedServer
from driving import (
    TESTED,
    attempts,
    carstage,
    children_that_live,
    command,
    differing,
    events,
    hashes,
    status,
    wait_for,
)

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("runs")]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory, small: str, home: Path) -> Path:
    """A dataset recorded without any trouble."""
    out = tmp_path_factory.mktemp("undisturbed") / "dataset"
    ended = carstage(["run", small, "--out", str(out), "--json", *TESTED], home)
    assert ended.code == 0, ended.stderr
    result = json.loads(ended.stdout.splitlines()[-1])
    assert result["state"] == "done"
    assert result["episodes"] == {"total": 1, "committed": 1, "skipped": 0, "failed": 0}
    assert result["frames"] == 20
    return out


def test_run_leaves_a_complete_dataset_and_nothing_else(undisturbed: Path) -> None:
    (marker_path,) = (undisturbed / "commits").glob("*.json")
    marker = json.loads(marker_path.read_bytes())
    assert marker["frames"] == 20
    assert marker["versions"]["client"] == "0.9.16"
    assert attempts(undisturbed) == [f"{marker_path.stem}/a1"]
    (run,) = (undisturbed / "runs").iterdir()
    assert not (run / "raw").exists()
    assert status(undisturbed)["state"] == "done"
    assert children_that_live(undisturbed) == []


def test_events_tell_the_run_in_order(undisturbed: Path) -> None:
    names = [event["event"] for event in events(undisturbed)]
    told = [
        "run_started",
        "server_tested",
        "server_started",
        "attempt_reserved",
        "collector_started",
        "connected",
        "episode_started",
        "actors_spawned",
        "episode_recorded",
        "collector_finished",
        "episode_committed",
        "server_stopped",
        "run_finished",
    ]
    assert [name for name in dict.fromkeys(names) if name in told] == told


def test_same_command_again_records_nothing(undisturbed: Path, small: str, home: Path) -> None:
    before = hashes(undisturbed)
    ended = carstage(["run", small, "--out", str(undisturbed), "--json"], home)
    assert ended.code == 0, ended.stderr
    result = json.loads(ended.stdout.splitlines()[-1])
    assert result["episodes"] == {"total": 1, "committed": 0, "skipped": 1, "failed": 0}
    assert "server_started" not in [event["event"] for event in events(undisturbed)]
    assert hashes(undisturbed) == before


def test_episode_that_always_fails_is_given_up_after_its_retries(
    small: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    settings = ["--set", "duration_s=600", "--retries", "1", "--json"]
    with command(["run", small, "--out", str(out), *settings], home) as running:
        for attempt in ("a1", "a2"):
            started = wait_for(
                lambda name=attempt: [
                    event
                    for event in events(out)
                    if event["event"] == "episode_started" and event["attempt"] == name
                ],
                f"attempt {attempt}",
            )
            assert started
            pids = [e["pid"] for e in events(out) if e["event"] == "collector_started"]
            os.kill(pids[-1], signal.SIGKILL)
        ended = running.end()
    assert ended.code == 1, ended.stderr
    result = json.loads(ended.stdout.splitlines()[-1])
    assert result["episodes"]["failed"] == 1
    assert attempts(out) == []
    assert children_that_live(out) == []


def test_server_that_runs_already_gives_the_same_bytes_and_stays(
    undisturbed: Path, small: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    with EmbeddedServer(log_path=tmp_path / "server.log") as server:
        place = f"{{kind: remote, host: 127.0.0.1, port: {server.endpoint.port}}}"
        ended = carstage(["run", small, "--out", str(out), "--set", f"server={place}"], home)
        assert ended.code == 0, ended.stderr
        assert server.alive()
    assert differing(out, undisturbed) == []
    (marker,) = (json.loads(path.read_bytes()) for path in (out / "commits").glob("*.json"))
    assert marker["self_test"]["ok"]  # servers that are not ours are tested before the run
    assert status(out)["state"] == "done"


def test_shares_at_the_same_time_are_together_the_whole_run(
    small: str, home: Path, tmp_path: Path
) -> None:
    whole, shared = tmp_path / "whole", tmp_path / "shared"
    short = ["--set", "episodes=3", "--set", "duration_s=0.3", "--json"]
    assert carstage(["run", small, "--out", str(whole), *short], home).code == 0
    arguments = ["run", small, "--out", str(shared), *short, "--shard"]
    with command([*arguments, "1/2"], home) as first, command([*arguments, "2/2"], home) as second:
        results = [running.end() for running in (first, second)]
    assert [ended.code for ended in results] == [0, 0], [ended.stderr for ended in results]
    counts = [json.loads(ended.stdout.splitlines()[-1])["episodes"] for ended in results]
    assert [(count["total"], count["committed"]) for count in counts] == [(2, 2), (1, 1)]
    assert differing(shared, whole) == []
    # Whoever asks for all of it then finds it done, and is not asked whether it belongs there.
    again = carstage(["run", small, "--out", str(shared), *short], home)
    assert again.code == 0, again.stderr
    assert json.loads(again.stdout.splitlines()[-1])["episodes"]["skipped"] == 3


def test_a_share_that_has_no_episode_is_done_at_once(
    small: str, home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    ended = carstage(["run", small, "--out", str(out), "--shard", "5/7", "--json"], home)
    assert ended.code == 0, ended.stderr
    assert json.loads(ended.stdout.splitlines()[-1])["episodes"]["total"] == 0
    ended = carstage(["run", small, "--out", str(out), "--shard", "8/7"], home)
    assert (ended.code, "shard: 8/7" in ended.stderr) == (2, True), ended.stderr


def test_a_server_that_lets_cameras_rest_gives_the_same_bytes_as_one_that_does_not(
    small: str, home: Path, tmp_path: Path
) -> None:
    settings = ["--set", "save_every=3", "--set", "output.keep_raw=true"]
    with EmbeddedServer(log_path=tmp_path / "server.log") as server:
        place = f"{{kind: remote, host: 127.0.0.1, port: {server.endpoint.port}, self_test: off}}"
        awake = ["--set", f"server={place}"]
        off = {}
        for name, given in (("awake", awake), ("resting", [])):
            out = tmp_path / name
            ended = carstage(["run", small, "--out", str(out), *settings, *given], home)
            assert ended.code == 0, ended.stderr
            (folder,) = (path.parent for path in out.rglob("raw/*/*/episode.json"))
            off[name] = [
                sorted(id for id, one in row["sensors"].items() if one["state"] == "off")
                for row in EpisodeLog(folder).ledger()
            ]
    assert differing(tmp_path / "resting", tmp_path / "awake") == []
    assert not any(off["awake"])
    assert not any(off["resting"][::3])
    assert all(len(one) >= 3 for tick, one in enumerate(off["resting"]) if tick % 3)
