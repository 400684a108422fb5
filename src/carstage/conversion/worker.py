"""A process of the conversion pool: takes one task after another from a socket and answers.

It is started by ``conversion_pool`` and imports neither the caller's main module nor
``multiprocessing``, so a script needs no ``if __name__ == "__main__"`` and a start is cheap.

A task is the pickle of ``(function, arguments, keyword arguments)``, an answer that of
``(succeeded, result or error, traceback)``. Both travel as pickled bytes: a task that cannot be
unpickled fails alone and leaves the stream whole.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import select
import signal
import socket
import threading
import traceback
from contextlib import suppress
from typing import Any

from carstage.errors import BadInputError

THREAD_LIMITS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)
"""Variables that the pool sets to 1 in the environment of its workers."""
_NICENESS = 5
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGEST_KEPT_BYTES = 32 << 20
"""As much as the allocator allows."""
_KEPT_BYTES = 128 << 20


def serve(descriptor: int) -> None:
    """Work until the other end of the socket is closed; does not return.

    Args:
        descriptor: of one end of a pair of connected sockets; the pool has the other.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _keep_memory()
    os.nice(_NICENESS)
    threading.Thread(target=_end_with_pool, args=(descriptor,), daemon=True).start()
    with (
        suppress(EOFError, OSError),
        socket.socket(fileno=descriptor) as connection,
        connection.makefile("rwb") as stream,
    ):
        while True:
            pickle.dump(_answer(pickle.load(stream)), stream)
            stream.flush()
    os._exit(0)  # taking apart all that was imported takes a third of a second


def _answer(task: bytes) -> bytes:
    """The pickled answer to a pickled task."""
    try:
        function, arguments, keywords = _unpickled(task)
        return pickle.dumps((True, function(*arguments, **keywords), ""))
    except BaseException as error:  # noqa: BLE001 - the caller raises it where the result is read
        return _pickled_error(error, traceback.format_exc())


def _unpickled(task: bytes) -> Any:
    try:
        return pickle.loads(task)
    except AttributeError as error:
        raise BadInputError(
            f"A process of the pool cannot find what it should run: {error}.",
            "Define it in a module that the program imports; the program itself is not run there.",
        ) from error


def _pickled_error(error: BaseException, trace: str) -> bytes:
    answer: tuple[bool, Any, str] = (False, error, trace)
    try:
        data = pickle.dumps(answer)
        pickle.loads(data)  # some errors can be pickled but not made again
    except Exception:  # noqa: BLE001 - whatever pickling an unknown error raises
        return pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}"), trace))
    return data


def _keep_memory() -> None:
    """Let the allocator keep what pictures need: the next one needs as much again.

    Else it goes back to the system after each, and every page of the next one's is cleared anew.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:  # of the GNU C library
        mallopt(_M_MMAP_THRESHOLD, _LARGEST_KEPT_BYTES)
        mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)


def _end_with_pool(descriptor: int) -> None:
    """Leave when the pool's end is closed, in the middle of a task too: its process is gone."""
    poll = select.poll()
    poll.register(descriptor, select.POLLRDHUP)
    poll.poll()
    os._exit(1)
