"""Attempts of concurrent runs never share a folder; what dead runs left is found and removed."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from carstage.runs.attempts import LeftRun, clear_up, left_runs, sweep
from carstage.runs.folder import EpisodeCounts, RunFolder, RunStatus
from carstage.runs.identity import identify, is_alive
from carstage.runs.orphans import marked
from carstage.runs.pending import Pending, write_pending
from carstage.storage import LocalStore, open_store

EPISODE = "00112233aabbccdd"
NO_SUCH_PID = 2**22 + 1  # above the kernel's largest pid


def gone(**changes: Any) -> dict[str, Any]:
    """A process of this namespace that is gone, with changes."""
    return {**identify(), "pid": NO_SUCH_PID, "pid_started": 1.0, **changes}


def begin_run(
    out: Path, process: dict[str, Any], *, state: str = "recording", silent_s: float = 0.0
) -> Path:
    """A run folder as a run leaves it that stopped after its first attempt was reserved."""
    with RunFolder(out, process=process) as folder:
        status = RunStatus(
            run_id=folder.run_id,
            state=state,  # type: ignore[arg-type]
            process=process,
            heartbeat=0.0,
            episodes=EpisodeCounts(total=1),
        )
        folder.write_status(status)
        holder = {"run_id": folder.run_id, **process}
        attempt = open_store(out).reserve_attempt(EPISODE, holder)
        folder.write_event("attempt_reserved", {"episode_id": EPISODE, "attempt": attempt})
        (out / "episodes" / EPISODE / attempt / "frames.parquet").write_bytes(b"half")
        raw = folder.raw_attempt(EPISODE, attempt)
        raw.mkdir(parents=True)
        (raw / "episode.json").write_text("{}")
        path = folder.path / "status.json"
        written = json.loads(path.read_bytes())
        path.write_text(json.dumps({**written, "heartbeat": time.time() - silent_s}))
        return folder.path


def dead_run(out: Path) -> LeftRun:
    (run,) = left_runs(out, LocalStore(out))
    assert run.dead
    return run


def test_run_of_a_process_that_is_gone_is_dead_and_is_cleared(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    folder = begin_run(tmp_path, gone())
    dead = dead_run(tmp_path)
    assert (dead.folder, dead.attempts) == (folder, ((EPISODE, "a1"),))
    clear_up(dead, store)
    assert not (folder / "raw").exists()
    assert not (tmp_path / "episodes" / EPISODE).exists()
    assert json.loads((folder / "status.json").read_bytes())["state"] == "interrupted"
    assert list(left_runs(tmp_path, LocalStore(tmp_path))) == []


def test_pid_that_another_process_has_now_is_a_dead_run(tmp_path: Path) -> None:
    begin_run(tmp_path, {**identify(), "pid_start_ticks": 1})
    assert dead_run(tmp_path)


def test_run_that_lives_is_left_alone_however_long_it_is_silent(tmp_path: Path) -> None:
    begin_run(tmp_path, identify(), silent_s=1e6)
    assert list(left_runs(tmp_path, LocalStore(tmp_path))) == []


def test_setting_the_clock_makes_no_living_run_dead(tmp_path: Path) -> None:
    begin_run(tmp_path, {**identify(), "pid_started": 1.0}, silent_s=-1e6)
    assert list(left_runs(tmp_path, LocalStore(tmp_path))) == []


@pytest.mark.parametrize("state", ["done", "failed", "interrupted"])
def test_run_that_ended_is_not_dead(tmp_path: Path, state: str) -> None:
    begin_run(tmp_path, gone(), state=state)
    assert list(left_runs(tmp_path, LocalStore(tmp_path))) == []


ELSEWHERE = {
    "another container": {"pid_namespace": "pid:[1]"},
    "another machine": {"boot_id": "other", "machine": "other"},
    "another machine of the same image": {"boot_id": "other", "machine": "other", "host": "x"},
    "an older version": {"boot_id": None, "pid_namespace": None, "pid_start_ticks": None},
}


@pytest.mark.parametrize("changes", ELSEWHERE.values(), ids=ELSEWHERE)
def test_run_that_cannot_be_seen_is_left_and_named_once_it_is_silent(
    tmp_path: Path, changes: dict[str, Any]
) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    now = {"pid_started": time.time()}
    begin_run(tmp_path, gone(**{**now, **changes}))
    assert list(left_runs(tmp_path, LocalStore(tmp_path))) == []  # its heartbeat is fresh
    folder = begin_run(tmp_path, gone(**{**now, **changes}), silent_s=3600.0)
    (silent,) = left_runs(tmp_path, LocalStore(tmp_path))
    assert (silent.folder, silent.dead) == (folder, False)
    told = clear_up(silent, store)
    assert folder.name in told
    assert str(folder / "raw") in told
    assert (folder / "raw" / EPISODE / "a2" / "episode.json").exists()
    assert (tmp_path / "episodes" / EPISODE / "a2" / "frames.parquet").exists()


LOOK = """
import sys
from pathlib import Path
from carstage.runs import left_runs
from carstage.storage import LocalStore
print([run.dead for run in left_runs(Path(sys.argv[1]), LocalStore(Path(sys.argv[1])))])
"""


def test_run_in_another_container_on_this_machine_is_not_taken_for_dead(tmp_path: Path) -> None:
    container = ["unshare", "--pid", "--fork", "--mount-proc"]
    if shutil.which("unshare") is None or subprocess.run([*container, "true"]).returncode:
        pytest.skip("no PID namespaces for this user")
    begin_run(tmp_path, identify(), silent_s=3600.0)  # this process, which lives
    command = [*container, sys.executable, "-c", LOOK, str(tmp_path)]
    assert subprocess.run(command, capture_output=True, check=True).stdout == b"[False]\n"
    begin_run(tmp_path, gone(), silent_s=3600.0)
    assert [run.dead for run in left_runs(tmp_path, LocalStore(tmp_path))] == [True]


def test_silent_run_loses_what_can_never_be_committed(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    folder = begin_run(tmp_path, gone(pid_namespace="pid:[1]"), silent_s=3600.0)
    winner = store.reserve_attempt(EPISODE, {})
    (tmp_path / "episodes" / EPISODE / winner / "frames.parquet").write_bytes(b"whole")
    store.commit(EPISODE, winner, frames=1, versions={})
    (silent,) = left_runs(tmp_path, LocalStore(tmp_path))
    assert clear_up(silent, store) == ""
    assert not (tmp_path / "episodes" / EPISODE / "a1").exists()
    assert not (folder / "raw" / EPISODE / "a1").exists()
    assert (tmp_path / "episodes" / EPISODE / winner / "frames.parquet").exists()


def test_run_of_before_the_machine_was_started_anew_is_dead(tmp_path: Path) -> None:
    since_boot_s = time.time() - psutil.boot_time()
    before = gone(boot_id="the boot before")
    if not before["machine"]:
        pytest.skip("this machine has no /etc/machine-id")
    begin_run(tmp_path, before, silent_s=since_boot_s + 60.0)
    assert dead_run(tmp_path)


def test_run_with_a_heartbeat_since_the_boot_was_on_another_machine(tmp_path: Path) -> None:
    begin_run(tmp_path, gone(boot_id="another machine's"), silent_s=61.0)
    (run,) = left_runs(tmp_path, LocalStore(tmp_path))
    assert not run.dead


@pytest.mark.parametrize("content", ["", "{", "[]"])
def test_status_that_a_power_cut_spoilt_hides_no_dead_run(tmp_path: Path, content: str) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    folder = begin_run(tmp_path, gone())
    (folder / "status.json").write_text(content)
    (folder / "events.jsonl").write_text("")  # the leases tell what it had begun
    dead = dead_run(tmp_path)
    assert dead.attempts == ((EPISODE, "a1"),)
    clear_up(dead, store)
    assert not (folder / "raw").exists()
    assert list(left_runs(tmp_path, LocalStore(tmp_path))) == []


def test_processes_that_a_dead_run_left_are_ended_before_its_files(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    begun_s = time.time()
    folder = begin_run(tmp_path, gone(pid_started=begun_s))
    with marked(folder.name):
        program = "print(flush=True); import time; time.sleep(600)"
        orphan = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE)
    with orphan:
        assert orphan.stdout is not None
        orphan.stdout.readline()  # before that, within exec, it has no environment yet
        dead = dead_run(tmp_path)
        clear_up(dead, store)
        ended = not psutil.pid_exists(orphan.pid)
        orphan.kill()  # nothing, where it is gone
    assert ended


def test_committed_attempt_of_a_dead_run_stays(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    begin_run(tmp_path, gone())
    store.commit(EPISODE, "a1", frames=1, versions={})
    dead = dead_run(tmp_path)
    clear_up(dead, store)
    assert (tmp_path / "episodes" / EPISODE / "a1" / "frames.parquet").read_bytes() == b"half"


@pytest.mark.parametrize("keep", [True, False])
def test_raw_recordings_that_were_to_be_kept_are_kept(tmp_path: Path, keep: bool) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    folder = begin_run(tmp_path, gone())
    (folder / "plan.json").write_text(json.dumps({"config": {"output": {"keep_raw": keep}}}))
    store.commit(EPISODE, "a1", frames=1, versions={})
    unfinished = folder / "raw" / EPISODE / "a2"
    unfinished.mkdir()
    dead = dead_run(tmp_path)
    clear_up(dead, store)
    assert (folder / "raw" / EPISODE / "a1" / "episode.json").exists() is keep
    assert (folder / "raw").exists() is keep
    assert not unfinished.exists()


def test_attempt_names_from_an_event_file_cannot_leave_the_dataset(tmp_path: Path) -> None:
    folder = begin_run(tmp_path, gone())
    with (folder / "events.jsonl").open("a") as events:
        line = {"event": "attempt_reserved", "episode_id": "..", "attempt": "../runs"}
        events.write(json.dumps(line) + "\nnot json\n")
    dead = dead_run(tmp_path)
    assert dead.attempts == ((EPISODE, "a1"),)


def test_status_without_a_pid_is_not_alive() -> None:
    assert not is_alive({"state": "recording"})


def test_what_an_ended_run_could_not_remove_is_swept(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    store.initialise("test")
    committed, failed = "0" * 16, "1" * 16
    for episode_id in (committed, failed):
        for attempt in ("a1", "a2"):
            assert store.reserve_attempt(episode_id, {"run_id": "over"}) == attempt
            (store.attempt_folder(episode_id, attempt) / "episode.json").write_text("{}")
    store.commit(committed, "a2", frames=1, versions={})
    waiting = tmp_path / "runs/over/raw" / failed / "a2"
    for folder in (waiting, waiting.with_name("a1")):
        folder.mkdir(parents=True)
    write_pending(waiting, Pending({}, {}, None, durable=True))
    old = tmp_path / "episodes" / ("2" * 16) / "a1"  # of a version without leases
    old.mkdir(parents=True)
    status = tmp_path / "runs/over/status.json"
    status.write_text(json.dumps({"state": "recording"}))
    sweep(tmp_path, store, store.committed())
    assert len(list(tmp_path.glob("episodes/*/*"))) == 5  # a run goes on
    status.write_text(json.dumps({"state": "failed"}))
    sweep(tmp_path, store, store.committed())
    left = {str(path.relative_to(tmp_path)) for path in tmp_path.glob("episodes/*/*")}
    assert left == {f"episodes/{committed}/a2", f"episodes/{failed}/a2", f"episodes/{'2' * 16}/a1"}
    assert list((tmp_path / "runs/over/raw").glob("*/*")) == [waiting]
