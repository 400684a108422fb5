"""The end of a process that has used a client."""

from __future__ import annotations

import os
import sys
from typing import NoReturn


def leave(code: int) -> NoReturn:
    """End the process at once, with all written.

    The client's threads live on while Python takes itself apart. One that delivers a frame or asks
    for Python's lock then aborts the process: SIGSEGV ended 4 of 100 programs with sensors that
    still listened, and none of 58 that ended so. A recording that is whole would count as failed.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
