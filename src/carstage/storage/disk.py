"""Errors of the file system as the run tells them."""

from __future__ import annotations

import errno

from carstage.errors import DiskFullError, StorageError

OUT_OF_SPACE = frozenset((errno.ENOSPC, errno.EDQUOT, errno.EFBIG))


def disk_error(error: OSError, what: str) -> StorageError:
    """The error to raise when writing failed.

    Args:
        error: the system's.
        what: what was being written, such as ``events.jsonl of run …``.
    """
    # str: libraries raise errors that have a text alone.
    message = f"Writing {what} failed: {error.strerror or error}."
    if error.errno in OUT_OF_SPACE or "No space left" in str(error):
        return DiskFullError(message, "Make room; the same command again continues.")
    return StorageError(message, "Check the disk and the permissions of the output folder.")
