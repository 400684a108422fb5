"""Files that one process holds; the system gives them back with it, however it ends."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from typing import BinaryIO


def take_lock(path: Path, mode: int) -> BinaryIO | None:
    """Hold a file until the handle is closed; None where another handle holds it.

    Args:
        path: made where it is missing.
        mode: of a file that is made.

    Raises:
        OSError: it cannot be made or opened.
    """
    handle = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, mode), "r+b", 0)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        handle.close()
        return None
    except BaseException:
        handle.close()
        raise
    return handle
