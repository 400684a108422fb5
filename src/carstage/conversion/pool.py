"""The processes that convert: few threads each, deaf to Ctrl-C, gone when their parent is gone."""

from __future__ import annotations

import atexit
import ctypes
import gc
import importlib
import multiprocessing
import os
import signal
import threading
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing.connection import wait

_THREAD_LIMITS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)
_NICENESS = 5
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGEST_KEPT_BYTES = 32 << 20
"""As much as the allocator allows."""
_KEPT_BYTES = 128 << 20


def conversion_pool(workers: int | None = None) -> Executor:
    """Processes for ``EpisodeConversion``; the caller shuts the executor down.

    The workers are spawned, not forked (the caller may have threads); they ignore SIGINT, so that
    the caller alone decides what Ctrl-C means, run at a lower priority than the simulator, and
    end when the caller dies, however it does.

    Args:
        workers: number of processes; default: the number of usable CPU cores.
    """
    return ProcessPoolExecutor(
        max_workers=workers or len(os.sched_getaffinity(0)),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_initialise_worker,
    )


def load_libraries(pictures: bool) -> None:
    """Import what work on a segment needs, and encode a picture: up to two seconds of a process.

    Args:
        pictures: also what only pictures need, which is more than half of it.
    """
    # What is made by an import stays; looking through it for garbage again and again is a third
    # of the time.
    gc.disable()
    try:
        # Not before this is called: the supervisor needs none of it.
        importlib.import_module("carstage.conversion.segment")
        from carstage.codecs.images import RgbRunsPng

        if pictures:
            importlib.import_module("carstage.annotation.pixel_kernel")
            # The first call of compiled code takes as long as the imports.
            RgbRunsPng().encode({"width": 1, "height": 1}, memoryview(bytes(4)))
    finally:
        gc.freeze()
        gc.enable()


def _initialise_worker() -> None:
    """Run once in each worker, before the numerical libraries are loaded where that is possible."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    atexit.register(os._exit, 0)  # taking apart all that was imported takes a third of a second
    _keep_memory()
    os.environ.update(dict.fromkeys(_THREAD_LIMITS, "1"))
    os.nice(_NICENESS)
    threading.Thread(target=_end_with_parent, name="parent-watch", daemon=True).start()


def _keep_memory() -> None:
    """Let the allocator keep what pictures need: the next one needs as much again.

    Else it goes back to the system after each, and every page of the next one's is cleared anew.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:  # of the GNU C library
        mallopt(_M_MMAP_THRESHOLD, _LARGEST_KEPT_BYTES)
        mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)


def _end_with_parent() -> None:
    """Leave when the parent is gone: a pool's worker would wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
