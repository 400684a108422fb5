"""Temporary files and folders that go with their owner, also with one that was killed.

Each is locked by the process that made it, and the system gives the lock back however that ends.
Whoever makes the next one of the same name's beginning removes those that nobody holds any more.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import stat
import tempfile
import weakref
from contextlib import suppress
from pathlib import Path


class Scratch:
    """A folder, or an empty file, in the folder for temporary files; a context manager.

    What is not given back before goes with this object, or at the end of the process.

    Args:
        prefix: how its name begins; all whose names begin so must be made by this class.
        suffix: how its name ends.
        folder: whether it is a folder.

    Attributes:
        path: its place.

    Raises:
        OSError: it cannot be made.
    """

    def __init__(self, prefix: str, suffix: str = "", *, folder: bool = True) -> None:
        _remove_orphans(prefix, suffix)
        while True:
            self.path = _made(prefix, suffix, folder)
            held = _lock(self.path)
            if held is not None:  # else somebody took it for an orphan before it was locked
                break
        self._end = weakref.finalize(self, _give_back, self.path, held)

    def __enter__(self) -> Scratch:
        return self

    def __exit__(self, *_: object) -> None:
        self.remove()

    def remove(self) -> None:
        """Remove it, with all that is in it; a second time is none too many."""
        self._end()


def _made(prefix: str, suffix: str, folder: bool) -> Path:
    if folder:
        return Path(tempfile.mkdtemp(suffix, prefix))
    handle, name = tempfile.mkstemp(suffix, prefix)
    os.close(handle)
    return Path(name)


def _lock(path: Path) -> int | None:
    """A descriptor that locks what is there under a name now; None where another one does."""
    try:
        held = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.path.samestat(os.fstat(held), path.lstat()):
            return held
    except OSError:
        pass
    os.close(held)
    return None


def _remove_orphans(prefix: str, suffix: str) -> None:
    """Remove what owners of this user left that are gone."""
    for path in Path(tempfile.gettempdir()).glob(f"{prefix}*{suffix}"):
        with suppress(OSError):
            if path.lstat().st_uid != os.geteuid():
                continue
        held = _lock(path)
        if held is not None:
            _give_back(path, held)


def _give_back(path: Path, held: int) -> None:
    """Remove it while it is locked."""
    _remove(path)
    os.close(held)


def _remove(path: Path) -> None:
    with suppress(OSError):
        if stat.S_ISDIR(path.lstat().st_mode):
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()
