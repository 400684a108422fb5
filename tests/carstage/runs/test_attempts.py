"""Attempts of concurrent runs never share a folder; what dead runs left is found and removed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import psutil
import pytest

from carstage.errors import StorageError
from carstage.runs.attempts import dead_runs, remove_leftovers, reserve_attempt
from carstage.runs.folder import (
    EpisodeCounts,
    RunFolder,
    RunStatus,
    is_alive,
    process_start_time,
)
from carstage.runs.orphans import marked
from carstage.storage import open_store

EPISODE = "00112233aabbccdd"
NO_SUCH_PID = 2**22 + 1  # above the kernel's largest pid


def begin_run(out: Path, *, pid: int, started: float, state: str = "recording") -> Path:
    """A run folder as a run leaves it that stopped after its first attempt was reserved."""
    with RunFolder(out) as folder:
        status = RunStatus(
            run_id=folder.run_id,
            state=state,  # type: ignore[arg-type]
            pid=pid,
            pid_started=started,
            heartbeat=0.0,
            episodes=EpisodeCounts(total=1),
        )
        folder.write_status(status)
        attempt = reserve_attempt(out, EPISODE)
        folder.write_event("attempt_reserved", {"episode_id": EPISODE, "attempt": attempt})
        (out / "episodes" / EPISODE / attempt / "frames.parquet").write_bytes(b"half")
        raw = folder.raw_attempt(EPISODE, attempt)
        raw.mkdir(parents=True)
        (raw / "episode.json").write_text("{}")
        return folder.path


def test_attempts_are_numbered_from_one_without_reuse(tmp_path: Path) -> None:
    assert [reserve_attempt(tmp_path, EPISODE) for _ in range(3)] == ["a1", "a2", "a3"]


def test_number_may_have_a_lower_bound(tmp_path: Path) -> None:
    assert reserve_attempt(tmp_path, EPISODE, first=4) == "a4"


def test_concurrent_reservations_are_distinct(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as threads:
        names = list(threads.map(lambda _: reserve_attempt(tmp_path, EPISODE), range(40)))
    assert len(set(names)) == 40


def test_reservation_that_cannot_be_made_is_a_storage_error(tmp_path: Path) -> None:
    (tmp_path / "episodes").write_text("a file")
    with pytest.raises(StorageError, match="cannot be created"):
        reserve_attempt(tmp_path, EPISODE)


def test_run_of_a_process_that_is_gone_is_dead_and_is_cleared(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    folder = begin_run(tmp_path, pid=NO_SUCH_PID, started=1.0)
    (dead,) = dead_runs(tmp_path)
    assert (dead.folder, dead.attempts) == (folder, ((EPISODE, "a1"),))
    remove_leftovers(dead, store)
    assert not (folder / "raw").exists()
    assert not (tmp_path / "episodes" / EPISODE).exists()
    assert json.loads((folder / "status.json").read_bytes())["state"] == "interrupted"
    assert list(dead_runs(tmp_path)) == []


def test_pid_that_another_process_has_now_is_a_dead_run(tmp_path: Path) -> None:
    folder = begin_run(tmp_path, pid=os.getpid(), started=process_start_time(os.getpid()) - 100.0)
    path = folder / "status.json"
    status = {**json.loads(path.read_bytes()), "heartbeat": time.time() - 600.0}
    path.write_text(json.dumps(status))
    assert len(list(dead_runs(tmp_path))) == 1


def test_run_that_lives_is_left_alone(tmp_path: Path) -> None:
    begin_run(tmp_path, pid=os.getpid(), started=process_start_time(os.getpid()))
    assert list(dead_runs(tmp_path)) == []


@pytest.mark.parametrize("state", ["done", "failed", "interrupted"])
def test_run_that_ended_is_not_dead(tmp_path: Path, state: str) -> None:
    begin_run(tmp_path, pid=NO_SUCH_PID, started=1.0, state=state)
    assert list(dead_runs(tmp_path)) == []


@pytest.mark.parametrize(("silent_s", "dead"), [(60.0, 0), (3600.0, 1)])
def test_run_on_another_machine_is_judged_by_its_heartbeat(
    tmp_path: Path, silent_s: float, dead: int
) -> None:
    folder = begin_run(tmp_path, pid=NO_SUCH_PID, started=1.0)
    path = folder / "status.json"
    status = json.loads(path.read_bytes())
    status.update(host="elsewhere", heartbeat=time.time() - silent_s)
    path.write_text(json.dumps(status))
    assert [run.foreign for run in dead_runs(tmp_path)] == [True] * dead


def test_processes_that_a_dead_run_left_are_ended_before_its_files(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    begun_s = time.time()
    folder = begin_run(tmp_path, pid=NO_SUCH_PID, started=begun_s)
    with marked(folder.name):
        program = "print(flush=True); import time; time.sleep(600)"
        orphan = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE)
    with orphan:
        assert orphan.stdout is not None
        orphan.stdout.readline()  # before that, within exec, it has no environment yet
        (dead,) = dead_runs(tmp_path)
        remove_leftovers(dead, store)
        gone = not psutil.pid_exists(orphan.pid)
        orphan.kill()  # nothing, where it is gone
    assert gone


def test_committed_attempt_of_a_dead_run_stays(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    begin_run(tmp_path, pid=NO_SUCH_PID, started=1.0)
    store.commit(EPISODE, "a1", frames=1, versions={})
    (dead,) = dead_runs(tmp_path)
    remove_leftovers(dead, store)
    assert (tmp_path / "episodes" / EPISODE / "a1" / "frames.parquet").read_bytes() == b"half"


@pytest.mark.parametrize("keep", [True, False])
def test_raw_recordings_that_were_to_be_kept_are_kept(tmp_path: Path, keep: bool) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    folder = begin_run(tmp_path, pid=NO_SUCH_PID, started=1.0)
    (folder / "plan.json").write_text(json.dumps({"config": {"output": {"keep_raw": keep}}}))
    store.commit(EPISODE, "a1", frames=1, versions={})
    unfinished = folder / "raw" / EPISODE / "a2"
    unfinished.mkdir()
    (dead,) = dead_runs(tmp_path)
    remove_leftovers(dead, store)
    assert (folder / "raw" / EPISODE / "a1" / "episode.json").exists() is keep
    assert (folder / "raw").exists() is keep
    assert not unfinished.exists()


def test_clock_that_is_set_makes_no_living_run_dead(tmp_path: Path) -> None:
    folder = begin_run(tmp_path, pid=os.getpid(), started=process_start_time(os.getpid()) - 100.0)
    path = folder / "status.json"
    status = {**json.loads(path.read_bytes()), "heartbeat": time.time()}
    path.write_text(json.dumps(status))
    assert list(dead_runs(tmp_path)) == []


def test_damaged_status_is_no_reason_to_remove_anything(tmp_path: Path) -> None:
    folder = begin_run(tmp_path, pid=NO_SUCH_PID, started=1.0)
    (folder / "status.json").write_text("{")
    assert list(dead_runs(tmp_path)) == []


def test_attempt_names_from_an_event_file_cannot_leave_the_dataset(tmp_path: Path) -> None:
    folder = begin_run(tmp_path, pid=NO_SUCH_PID, started=1.0)
    with (folder / "events.jsonl").open("a") as events:
        line = {"event": "attempt_reserved", "episode_id": "..", "attempt": "../runs"}
        events.write(json.dumps(line) + "\nnot json\n")
    (dead,) = dead_runs(tmp_path)
    assert dead.attempts == ((EPISODE, "a1"),)


def test_status_without_a_pid_is_not_alive() -> None:
    assert not is_alive({"state": "recording"})
