"""Reading files that somebody else may have made: regular ones, up to a size."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Protocol

LARGEST_DOCUMENT_BYTES = 1 << 28
"""Of a JSON document: markers list every file of an episode."""
LARGEST_FILE_BYTES = 1 << 31
"""Of a picture, a sweep or a table."""


class Openable(Protocol):
    """A path that is not of this machine's file system."""

    def opened(self, most_bytes: int) -> int:
        """A file descriptor to read its content by.

        Raises:
            OSError: there is none, or it is larger.
        """


_within: ContextVar[tuple[Path, ...] | None] = ContextVar("within", default=None)


@contextmanager
def reading_within(folders: Sequence[Path]) -> Iterator[None]:
    """A stretch in which files are read below some folders alone, whatever links say.

    For whoever hands on what it reads. It holds for this context, see ``contextvars``.

    Args:
        folders: resolved.
    """
    token = _within.set(tuple(folders))
    try:
        yield
    finally:
        _within.reset(token)


def read_bounded(path: Path | Openable, most_bytes: int = LARGEST_FILE_BYTES) -> bytes:
    """The content of a regular file.

    Nothing is read of a FIFO, a socket or a device, nor of a file that is too large; opening one
    does not wait for anybody either.

    Args:
        path: the file; one of an object store is fetched.
        most_bytes: the largest size that is read.

    Raises:
        OSError: it is no regular file, is larger, lies elsewhere than it may, or cannot be read.
    """
    descriptor = open_regular(path, most_bytes)
    with os.fdopen(descriptor, "rb") as file:
        return file.read()


def open_regular(path: Path | Openable, most_bytes: int = LARGEST_FILE_BYTES) -> int:
    """A file descriptor to read a regular file with.

    Raises:
        OSError: it is no regular file, is larger, lies elsewhere than it may, or cannot be opened.
    """
    if not isinstance(path, Path):
        return path.opened(most_bytes)
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "no regular file", str(path))
        if found.st_size > most_bytes:
            message = f"{found.st_size} bytes are more than {most_bytes}"
            raise OSError(errno.EFBIG, message, str(path))
        _check_place(descriptor, path)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def _check_place(descriptor: int, path: Path) -> None:
    """Refuse a file that is open and lies outside; links may change at any time before that."""
    folders = _within.get()
    if folders is None:
        return
    place = Path(f"/proc/self/fd/{descriptor}").readlink()
    if not any(place.is_relative_to(folder) for folder in folders):
        raise OSError(errno.EACCES, "a link leads out of the datasets' folders", str(path))
