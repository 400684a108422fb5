"""Names of attempts, and what dead runs have left behind.

An attempt of a run writes below ``episodes/<id>/<attempt>``. A run that was killed cannot remove
it; the next one does, when the process of the dead run is certainly gone.
"""

from __future__ import annotations

import json
import re
import secrets
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from carstage.errors import StorageError
from carstage.runs.folder import FINAL_STATES, is_alive
from carstage.runs.orphans import end_orphans
from carstage.storage import Store

_ATTEMPT = re.compile(r"a([1-9][0-9]*)")


def reserve_attempt(out: Path, episode_id: str, first: int = 1) -> str:
    """Create the folder of a new attempt; no other run can get the same one.

    Args:
        out: folder of the dataset.
        episode_id: id of the episode.
        first: lowest number to use.

    Raises:
        StorageError: the folder cannot be created.
    """
    folder = out / "episodes" / episode_id
    number = first
    try:
        folder.mkdir(parents=True, exist_ok=True)
        taken = [int(m[1]) for path in folder.iterdir() if (m := _ATTEMPT.fullmatch(path.name))]
        number = max([first, *(n + 1 for n in taken)])
        while True:
            with suppress(FileExistsError):
                (folder / f"a{number}").mkdir()
                return f"a{number}"
            number += 1
    except OSError as error:
        raise StorageError(
            f"The attempt's folder in {folder} cannot be created: {error.strerror}.",
            "Check the free space and the permissions of the output folder.",
        ) from error


@dataclass(frozen=True, slots=True)
class DeadRun:
    """A run whose process is gone though its status says otherwise.

    Attributes:
        attempts: (episode id, attempt) of what it had begun and neither committed nor removed.
        begun_s: Unix time at which its process began.
        foreign: whether it was on another machine, whose processes are not for us to end.
    """

    folder: Path
    attempts: tuple[tuple[str, str], ...]
    begun_s: float
    foreign: bool = False


def dead_runs(out: Path) -> Iterator[DeadRun]:
    """The dead runs of a dataset."""
    for status_path in sorted((out / "runs").glob("*/status.json")):
        try:
            status = json.loads(status_path.read_bytes())
        except (OSError, ValueError):
            continue
        if not isinstance(status, dict) or status.get("state") in FINAL_STATES or is_alive(status):
            continue
        folder = status_path.parent
        yield DeadRun(
            folder,
            tuple(sorted(_begun(folder / "events.jsonl", out))),
            float(status.get("pid_started") or time.time()),
            status.get("host", socket.gethostname()) != socket.gethostname(),
        )


def remove_leftovers(run: DeadRun, store: Store) -> None:
    """Remove what a dead run has left, and mark it as interrupted.

    First its processes, which could still write; then its raw recordings and unfinished attempts.
    """
    if not run.foreign:
        end_orphans(run.folder.name, run.begun_s)
    kept = _kept_recordings(run.folder, store)
    for episode_id, attempt in run.attempts:
        with suppress(StorageError):  # it was committed after all: it stays
            store.discard_attempt(episode_id, attempt)
    for recording in (run.folder / "raw").glob("*/*"):
        if recording not in kept:
            shutil.rmtree(recording, ignore_errors=True)
    for folder in (*(run.folder / "raw").glob("*"), run.folder / "raw"):
        with suppress(OSError):  # what is kept, or gone already
            folder.rmdir()
    path = run.folder / "status.json"
    status = json.loads(path.read_bytes())
    status["state"] = "interrupted"
    status["message"] = "The process of this run was gone; a later run removed what it had left."
    # Two runs that start together may both do this.
    temporary = path.with_name(f".status.json.{secrets.token_hex(8)}")
    temporary.write_text(json.dumps(status, indent=1), "utf-8")
    temporary.replace(path)


def _kept_recordings(folder: Path, store: Store) -> set[Path]:
    """Raw recordings of committed episodes, where the run's configuration keeps them."""
    try:
        config = json.loads((folder / "plan.json").read_bytes())["config"]
    except (OSError, ValueError, KeyError):
        return set()
    if not config.get("output", {}).get("keep_raw", False):
        return set()
    return {
        folder / "raw" / marker.episode_id / marker.attempt for marker in store.committed().values()
    }


def _begun(events: Path, out: Path) -> set[tuple[str, str]]:
    begun: set[tuple[str, str]] = set()
    with suppress(OSError):
        for line in events.read_text("utf-8", "replace").splitlines():
            with suppress(ValueError, KeyError, TypeError):
                event = json.loads(line)
                if event["event"] == "attempt_reserved":
                    begun.add((str(event["episode_id"]), str(event["attempt"])))
    return {
        (episode_id, attempt)
        for episode_id, attempt in begun
        if _ATTEMPT.fullmatch(attempt) and (out / "episodes" / episode_id / attempt).is_dir()
    }
