"""Reading files that somebody else may have made: regular ones, up to a size."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

LARGEST_DOCUMENT_BYTES = 1 << 28
"""Of a JSON document: markers list every file of an episode."""
LARGEST_FILE_BYTES = 1 << 31
"""Of a picture, a sweep or a table."""


def read_bounded(path: Path, most_bytes: int = LARGEST_FILE_BYTES) -> bytes:
    """The content of a regular file.

    Nothing is read of a FIFO, a socket or a device, nor of a file that is too large; opening one
    does not wait for anybody either.

    Args:
        path: the file.
        most_bytes: the largest size that is read.

    Raises:
        OSError: it is no regular file, is larger, or cannot be read.
    """
    descriptor = open_regular(path, most_bytes)
    with os.fdopen(descriptor, "rb") as file:
        return file.read()


def open_regular(path: Path, most_bytes: int = LARGEST_FILE_BYTES) -> int:
    """A file descriptor to read a regular file with.

    Raises:
        OSError: it is no regular file, is larger, or cannot be opened.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "no regular file", str(path))
        if found.st_size > most_bytes:
            message = f"{found.st_size} bytes are more than {most_bytes}"
            raise OSError(errno.EFBIG, message, str(path))
    except OSError:
        os.close(descriptor)
        raise
    return descriptor
