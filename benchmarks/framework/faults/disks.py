"""Disks that are full or slow."""

from __future__ import annotations

import os
import resource
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

_BALLAST = "ballast"
_BLOCK_BYTES = 4096

#: Read by every Python process that finds its folder on the path; slows down collectors alone.
_SLOW_WRITES = """\
import os, sys, threading

if "carstage.collector" in sys.orig_argv:
    _pwritev, _pause = os.pwritev, threading.Event()

    def pwritev(*arguments):
        _pause.wait({delay_s})
        return _pwritev(*arguments)

    os.pwritev = pwritev
"""


@contextmanager
def small_disk(folder: Path, size_bytes: int) -> Iterator[bool]:
    """A file system in memory at ``folder``; gives whether it could be mounted, as root can."""
    folder.mkdir(parents=True, exist_ok=True)
    mounted = (
        subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size_bytes}", "tmpfs", str(folder)],
            capture_output=True,
            check=False,
        ).returncode
        == 0
    )
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "--lazy", str(folder)], capture_output=True, check=False)


def fill_disk(folder: Path, leave_bytes: int) -> None:
    """Take all space of a file system but ``leave_bytes``."""
    space = os.statvfs(folder)
    size_bytes = max(0, space.f_bavail * space.f_frsize - leave_bytes)
    with suppress(OSError), (folder / _BALLAST).open("wb", buffering=0) as ballast:
        for _ in range(-(-size_bytes // _BLOCK_BYTES)):
            ballast.write(bytes(_BLOCK_BYTES))


def empty_disk(folder: Path) -> None:
    """Give the space back that ``fill_disk`` took."""
    (folder / _BALLAST).unlink(missing_ok=True)


def limit_files(pid: int, size_bytes: int) -> None:
    """Let a process, its descendants and what they start write no file longer than that.

    The stand-in for a full disk where none can be mounted: writes fail with EFBIG, not ENOSPC.
    """
    with suppress(psutil.Error):
        root = psutil.Process(pid)
        for process in [root, *root.children(recursive=True)]:
            with suppress(psutil.Error, OSError):
                resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (size_bytes, size_bytes))


def slow_writes(folder: Path, delay_s: float) -> Mapping[str, str]:
    """Environment in which each write of a collector to its log takes ``delay_s`` longer."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "sitecustomize.py").write_text(_SLOW_WRITES.format(delay_s=delay_s), "utf-8")
    path = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {"PYTHONPATH": os.pathsep.join(path)}
