"""Episodes that are wholly recorded and wait to be converted by the next run of the command.

A pending recording is the folder of an attempt's raw log with ``pending.json``, which says what of
it is converted. The run that made it is over. The next one on the dataset takes it by renaming its
folder into its own.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from carstage.files.whole import flush_folder, write_whole
from carstage.runs.folder import FINAL_STATES, PROCESS_FILE
from carstage.runs.identity import boot_id, life_of
from carstage.runs.reading import read_document
from carstage.storage import CommitMarker, Store
from carstage.storage.disk import disk_error

PENDING_FILE = "pending.json"
FORMAT_VERSION = 1


@dataclass(frozen=True, slots=True)
class Pending:
    """What ``pending.json`` says of a recording.

    Attributes:
        codecs: codec by sensor id, where it is not the kind's own.
        environment: what it was recorded with, by version.
        self_test: verdict on the server; None where it was not tested.
        durable: its raw log was brought to the disk.
        converted: what of it is converted, as ``EpisodeConversion.converted`` gives it.
        boot: boot of the machine in which it was written.
    """

    codecs: Mapping[str, str]
    environment: Mapping[str, str]
    self_test: Mapping[str, Any] | None
    durable: bool
    converted: Sequence[Mapping[str, Any]] = ()
    boot: str = field(default_factory=boot_id)

    @property
    def of_this_boot(self) -> bool:
        """Whether what was written can still be in memory alone: the machine never stopped."""
        return bool(self.boot) and self.boot == boot_id()


@dataclass(frozen=True, slots=True)
class PendingRecording:
    """A pending recording of a run that is over.

    Attributes:
        folder: of its raw log, ``runs/<run>/raw/<episode>/<attempt>``.
    """

    folder: Path
    pending: Pending

    @property
    def episode_id(self) -> str:
        """The episode's id."""
        return self.folder.parent.name

    @property
    def attempt(self) -> str:
        """The attempt's name; nobody else has it."""
        return self.folder.name

    def take(self, folder: Path) -> bool:
        """Move it to a place of the run that goes on with it; False where another run was faster.

        Raises:
            StorageError: it cannot be moved.
        """
        old = self.folder.parent
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            self.folder.rename(folder)
            (folder / PENDING_FILE).unlink()
            for changed in (folder, folder.parent, old):
                flush_folder(changed)
        except FileNotFoundError:
            return False
        except OSError as error:
            raise disk_error(error, str(folder)) from error
        for emptied in (old, old.parent):
            with suppress(OSError):  # others are kept there
                emptied.rmdir()
        return True


def write_pending(raw_folder: Path, pending: Pending) -> None:
    """Make a recording a pending one; that it is one is on the disk on return.

    Raises:
        StorageError: it cannot be written.
    """
    document = {"format_version": FORMAT_VERSION, **asdict(pending)}
    try:
        write_whole(raw_folder / PENDING_FILE, json.dumps(document).encode(), durable=True)
    except OSError as error:
        raise disk_error(error, str(raw_folder)) from error


def pending_recordings(work: Path) -> Iterator[PendingRecording]:
    """The pending recordings below ``work / "runs"``, of runs that have ended or are dead."""
    for run in sorted((work / "runs").glob("*")):
        status = read_document(run / "status.json") or read_document(run / PROCESS_FILE) or {}
        if status.get("state") in FINAL_STATES or life_of(status) == "dead":
            yield from pending_of(run)


def pending_of(run: Path) -> Iterator[PendingRecording]:
    """The pending recordings of a run's folder."""
    for path in sorted(run.glob(f"raw/*/*/{PENDING_FILE}")):
        document = read_document(path) or {}
        if document.pop("format_version", None) == FORMAT_VERSION:
            with suppress(TypeError):  # not ours
                yield PendingRecording(path.parent, Pending(**document))


def drop_superseded(work: Path, markers: Mapping[str, CommitMarker], store: Store) -> None:
    """Remove the pending recordings of episodes that are in the dataset by another attempt.

    Raises:
        StorageError: an attempt cannot be removed.
    """
    for recording in pending_recordings(work):
        marker = markers.get(recording.episode_id)
        if marker is None:
            continue
        if marker.attempt != recording.attempt:
            store.discard_attempt(recording.episode_id, recording.attempt)
            shutil.rmtree(recording.folder, ignore_errors=True)
        else:
            forget_pending(recording.folder)  # its run ended as it was committed


def forget_pending(raw_folder: Path) -> None:
    """Make a pending recording, which was converted, one like any other."""
    (raw_folder / PENDING_FILE).unlink(missing_ok=True)
