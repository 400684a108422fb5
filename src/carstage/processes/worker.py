"""The processes of a pool: workers, and the one that they are forked from.

The first is started by ``process_pool`` and imports neither the caller's main module nor
``multiprocessing``, so a script needs no ``if __name__ == "__main__"``. It loads what workers need
once, and is forked for each: a worker costs milliseconds, and shares the memory of its libraries.
It has one thread, which is what makes forking safe. A worker takes one task after another from a
socket and answers.

A task is the pickle of ``(function, arguments, keyword arguments)``, an answer that of
``(succeeded, result or error, traceback)``. Both travel as pickled bytes: a task that cannot be
unpickled fails alone and leaves the stream whole.
"""

from __future__ import annotations

import ctypes
import errno
import gc
import os
import pickle
import select
import signal
import socket
import struct
import threading
import traceback
from contextlib import suppress
from typing import Any, Final, NoReturn

from carstage.errors import BadInputError

ENVIRONMENT: Final = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "JE_ARROW_MALLOC_CONF": "background_thread:false",
}
"""No library starts a thread: of a process with several, a fork may inherit a lock that is held."""
NICENESS: Final = 5
"""Of what works beside the simulator."""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGEST_KEPT_BYTES = 32 << 20
"""As much as the allocator allows."""
_KEPT_BYTES = 128 << 20


LENGTH: Final = struct.Struct("<Q")
"""Before the pickled ``(function, arguments)`` that is called before the first fork."""
FORKED: Final = struct.Struct("<i")
"""The answer to :data:`FORK`: 0, or the number of the system's error."""
FORK: Final = b"f"
"""Comes with the descriptor of a socket: fork a worker that serves it."""
KILL: Final = b"k"
"""End all workers in the middle of their tasks."""
_PR_SET_PDEATHSIG: Final = 1


def fork_workers(descriptor: int) -> NoReturn:
    """Load what workers need, then fork one whenever the pool asks, until it closes the socket.

    Args:
        descriptor: of one end of a pair of connected sockets; the pool has the other.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    keep_memory()
    os.nice(NICENESS)
    with socket.socket(fileno=descriptor) as control:
        (size,) = LENGTH.unpack(_received(control, LENGTH.size))
        function, arguments = pickle.loads(_received(control, size))
        # What an import makes stays; looking through it for garbage again and again is a third of
        # the time.
        gc.disable()
        function(*arguments)
        gc.freeze()
        gc.enable()
        children: list[int] = []
        while True:
            command, descriptors, _, _ = socket.recv_fds(control, 1, 1)
            if command != FORK:
                break
            (worker,) = descriptors
            try:
                child = os.fork()
            except OSError as error:
                control.sendall(FORKED.pack(error.errno or errno.EAGAIN))
            else:
                if not child:
                    control.close()
                    _serve(worker)
                children.append(child)
                control.sendall(FORKED.pack(0))
            os.close(worker)
        if command == KILL:
            for child in children:
                os.kill(child, signal.SIGKILL)  # none has been waited for: the number is its own
        for child in children:
            os.waitpid(child, 0)
    os._exit(0)  # taking apart all that was imported takes a third of a second


def _received(control: socket.socket, size: int) -> bytes:
    """That many bytes.

    Raises:
        EOFError: the pool is gone.
    """
    data = bytearray()
    while len(data) < size:
        part = control.recv(size - len(data))
        if not part:
            raise EOFError
        data += part
    return bytes(data)


def _serve(descriptor: int) -> NoReturn:
    """Work until the other end of the socket is closed.

    Args:
        descriptor: of one end of a pair of connected sockets; the pool has the other.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    threading.Thread(target=_end_with_pool, args=(descriptor,), daemon=True).start()
    with (
        suppress(EOFError, OSError),
        socket.socket(fileno=descriptor) as connection,
        connection.makefile("rwb") as stream,
    ):
        while True:
            pickle.dump(_answer(pickle.load(stream)), stream)
            stream.flush()
    os._exit(0)


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


def keep_memory() -> None:
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
