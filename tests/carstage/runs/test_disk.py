"""A disk that refuses is told in words, and a full one never hides what happened before."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import pytest

from carstage.errors import DiskFullError, StorageError
from carstage.runs.folder import RunFolder
from carstage.storage.disk import disk_error


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOSPC, "No space left on device"),
        OSError(errno.EDQUOT, "Disk quota exceeded"),
        OSError(errno.EFBIG, "File too large"),
        OSError("Error writing bytes to file. Detail: [errno 28] No space left on device"),
    ],
)
def test_lack_of_space_is_told_apart(error: OSError) -> None:
    told = disk_error(error, "events.jsonl")
    assert isinstance(told, DiskFullError)
    assert "same command again" in told.hint


def test_other_faults_are_errors_of_the_store() -> None:
    told = disk_error(PermissionError(errno.EACCES, "Permission denied"), "status.json")
    assert type(told) is StorageError
    assert told.message == "Writing status.json failed: Permission denied."


class FullNow:
    """An event file whose disk is full after some bytes of one line."""

    def __init__(self, folder: RunFolder) -> None:
        self._file = folder._events
        self._room = 5

    def write(self, data: bytes) -> int:
        if not self._room:
            raise OSError(errno.ENOSPC, "No space left on device")
        written = self._file.write(data[: self._room])
        self._room = 0
        return written


def test_event_that_finds_no_room_tears_no_other(tmp_path: Path) -> None:
    with RunFolder(tmp_path) as folder:
        whole = folder._events
        folder.write_event("run_started", {})
        folder._events = FullNow(folder)  # type: ignore[assignment]
        with pytest.raises(DiskFullError):
            folder.write_event("episode_failed", {})
        folder._events = whole
        folder.write_event("run_finished", {})
        lines = (folder.path / "events.jsonl").read_text().splitlines()
    assert [json.loads(line)["event"] for line in (lines[0], lines[2])] == [
        "run_started",
        "run_finished",
    ]
    assert len(lines) == 3
