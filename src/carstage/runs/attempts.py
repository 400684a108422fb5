"""What runs have left behind that did not end.

An attempt of a run writes below ``episodes/<id>/<attempt>``. A run that was killed cannot remove
it. The next one does, where the process is certainly gone, or where another attempt is the episode.
"""

from __future__ import annotations

import json
import secrets
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from carstage.errors import StorageError
from carstage.runs.folder import FINAL_STATES, FORMAT_VERSION, PROCESS_FILE, EpisodeCounts
from carstage.runs.identity import life_of
from carstage.runs.orphans import end_orphans
from carstage.runs.pending import drop_superseded, pending_of, pending_recordings
from carstage.runs.reading import is_recent, read_document
from carstage.storage import CommitMarker, Store
from carstage.storage.names import ATTEMPT


@dataclass(frozen=True, slots=True)
class LeftRun:
    """A run that did not end and does not go on, as far as can be seen.

    Attributes:
        attempts: (episode id, attempt) of what it had begun and neither committed nor removed;
            what only waits to be converted is not among them.
        process: which process it was, as far as it is known.
        dead: its process is certainly gone. Else it is somewhere else, and silent: it may sleep.
    """

    folder: Path
    attempts: tuple[tuple[str, str], ...]
    process: Mapping[str, Any]
    dead: bool

    @property
    def describe(self) -> str:
        """Which run, and where it was."""
        return (
            f"run {self.folder.name} (process {self.process.get('pid', '?')} "
            f"on {self.process.get('host', 'an unknown machine')})"
        )


def left_runs(work: Path, store: Store) -> Iterator[LeftRun]:
    """The runs of a dataset that are dead, or silent where they cannot be seen.

    Known by ``status.json``; where a power cut has spoilt that, by ``process.json``.

    Args:
        work: what holds the folder ``runs``.
        store: the dataset.
    """
    for folder in sorted((work / "runs").glob("*")):
        status = read_document(folder / "status.json")
        process = status or read_document(folder / PROCESS_FILE)
        if process is None or (status is not None and status.get("state") in FINAL_STATES):
            continue
        life = life_of(process)
        if life == "dead" or (life == "unknown" and not is_recent(process)):
            waiting = {(one.episode_id, one.attempt) for one in pending_of(folder)}
            attempts = tuple(sorted(_begun(folder / "events.jsonl", store) - waiting))
            yield LeftRun(folder, attempts, process, life == "dead")


def dead_runs(work: Path, store: Store) -> Iterator[LeftRun]:
    """Those whose process is certainly gone."""
    return (run for run in left_runs(work, store) if run.dead)


def held_attempts(work: Path, store: Store) -> set[tuple[str, str]]:
    """Attempts (episode id, name) that somebody needs, marker or not.

    They are those of runs that go on, as far as can be seen, and those that only wait to be
    converted by the next run.

    Args:
        work: folder of the runs of this machine.
        store: the dataset.
    """
    needed = {(one.episode_id, one.attempt) for one in pending_recordings(work)}
    for folder in sorted((work / "runs").glob("*")):
        status = read_document(folder / "status.json")
        process = status or read_document(folder / PROCESS_FILE)
        if process is None or (status is not None and status.get("state") in FINAL_STATES):
            continue
        life = life_of(process)
        if life == "alive" or (life == "unknown" and is_recent(process)):
            needed |= _begun(folder / "events.jsonl", store)
    return needed


def clear_up(run: LeftRun, store: Store) -> str:
    """Remove what a run has left, as far as that is safe; says what was done.

    Of a dead run everything goes: first its processes, which could still write, then its raw
    recordings and unfinished attempts, but for those that only wait to be converted. Any other run
    may wake up and commit. Of such a one only attempts go that cannot be committed any more, as
    another attempt is the episode.
    """
    if run.dead:
        end_orphans(run.folder.name, float(run.process.get("pid_started") or time.time()))
    markers = store.committed()
    pending = {recording.folder for recording in pending_of(run.folder)}
    kept = _kept_recordings(run.folder, markers) | pending
    stays = False
    for episode_id, attempt in run.attempts:
        marker = markers.get(episode_id)
        if run.dead or (marker is not None and marker.attempt != attempt):
            with suppress(StorageError):  # it was committed after all: it stays
                store.discard_attempt(episode_id, attempt)
            if not run.dead:
                shutil.rmtree(run.folder / "raw" / episode_id / attempt, ignore_errors=True)
        else:
            stays = stays or marker is None
    if not run.dead:
        if not stays:
            return ""
        return (
            f"The {run.describe} says nothing, and cannot be seen from here. What it left stays: "
            f"if it is gone for good, delete {run.folder / 'raw'} and its attempts "
            + ", ".join(f"episodes/{episode_id}/{attempt}" for episode_id, attempt in run.attempts)
            + "."
        )
    for recording in (run.folder / "raw").glob("*/*"):
        if recording not in kept:
            shutil.rmtree(recording, ignore_errors=True)
    for folder in (*(run.folder / "raw").glob("*"), run.folder / "raw"):
        with suppress(OSError):  # what is kept, or gone already
            folder.rmdir()
    status = {
        "format_version": FORMAT_VERSION,
        "run_id": run.folder.name,
        "episodes": asdict(EpisodeCounts()),
        "current": None,
        "heartbeat": 0.0,
        **run.process,
        "state": "interrupted",
        "message": "The process of this run was gone; a later run removed what it had left.",
    }
    # Two runs that start together may both do this.
    path = run.folder / "status.json"
    temporary = path.with_name(f".status.json.{secrets.token_hex(8)}")
    temporary.write_text(json.dumps(status, indent=1), "utf-8")
    temporary.replace(path)
    return f"Removed what the dead run {run.folder.name} had left."


def sweep(work: Path, store: Store, markers: Mapping[str, CommitMarker]) -> None:
    """Remove what runs that have ended could not remove; nothing while another run goes on.

    An attempt goes where another one is the episode, or where the run that holds its lease ended.

    Args:
        work: what holds the folder ``runs``.
        store: the dataset.
        markers: of its episodes.
    """
    # Of what is no run, or one that has not begun, nothing is waited for.
    runs = [run for run in sorted((work / "runs").glob("*")) if _is_run(run)]
    ended = {run.name for run in runs if _has_ended(run)}
    if len(ended) < len(runs):
        return
    pending = {(one.episode_id, one.attempt) for one in pending_recordings(work)}
    for left in store.unfinished(markers):
        if (left.episode_id, left.attempt) in pending:
            continue
        over = left.episode_id in markers
        if left.holder is not None:
            over = left.holder.get("run_id") in ended
        if not over:
            continue
        with suppress(StorageError):  # it was committed after all: it stays
            store.discard_attempt(left.episode_id, left.attempt)
    for run in runs:
        kept = _kept_recordings(run, markers)
        for recording in (run / "raw").glob("*/*"):
            names = (recording.parent.name, recording.name)
            if names not in pending and recording not in kept:
                shutil.rmtree(recording, ignore_errors=True)
        for folder in (*(run / "raw").glob("*"), run / "raw"):
            with suppress(OSError):  # what is kept, or gone already
                folder.rmdir()


def clear_up_all(
    work: Path, store: Store, notice: Callable[[str], None]
) -> dict[str, CommitMarker]:
    """Clear up after earlier runs; returns the markers of the episodes that the dataset has.

    It comes first in a run, as what they left takes space on the disk.

    Args:
        work: what holds the folder ``runs``.
        store: the dataset; it need not exist.
        notice: called with sentences on what was done.

    Raises:
        StorageError: the dataset cannot be read.
    """
    for left in left_runs(work, store):
        if done := clear_up(left, store):
            notice(done)
    if not store.exists():
        return {}
    present = store.committed()
    drop_superseded(work, present, store)
    sweep(work, store, present)
    return present


def _is_run(folder: Path) -> bool:
    return any((folder / name).is_file() for name in ("status.json", PROCESS_FILE))


def _has_ended(run: Path) -> bool:
    return (read_document(run / "status.json") or {}).get("state") in FINAL_STATES


def _kept_recordings(folder: Path, markers: Mapping[str, CommitMarker]) -> set[Path]:
    """Raw recordings of committed episodes, where the run's configuration keeps them."""
    plan = read_document(folder / "plan.json") or {}
    if not plan.get("config", {}).get("output", {}).get("keep_raw", False):
        return set()
    return {folder / "raw" / marker.episode_id / marker.attempt for marker in markers.values()}


def _begun(events: Path, store: Store) -> set[tuple[str, str]]:
    """Attempts by the leases that the run holds, and by its events: old ones have no leases."""
    run_id, begun = events.parent.name, set[tuple[str, str]]()
    for left in store.unfinished({}):
        if left.holder is not None and left.holder.get("run_id") == run_id:
            begun.add((left.episode_id, left.attempt))
    with suppress(OSError):
        for line in events.read_text("utf-8", "replace").splitlines():
            with suppress(ValueError, KeyError, TypeError):
                event = json.loads(line)
                if event["event"] == "attempt_reserved":
                    begun.add((str(event["episode_id"]), str(event["attempt"])))
    return {
        (episode_id, attempt)
        for episode_id, attempt in begun
        if ATTEMPT.fullmatch(attempt) and store.has_attempt(episode_id, attempt)
    }
