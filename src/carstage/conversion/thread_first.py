"""Converting in a thread of this process, for as long as that keeps up."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any, Final, ParamSpec, TypeVar

from carstage.conversion.libraries import import_libraries
from carstage.processes import NICENESS, BrokenPoolError, ProcessPool

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")

MOST_WAITING: Final = 32
"""Tasks in the thread's queue from which on others are for processes: it lags behind.

Measured on 2 cores beside other work, with LiDARs of 100,000 points from a server that repeats
frames as fast as they are taken. With one LiDAR at 10 or 20 Hz 3 tasks wait at most, so any number
from 8 on is alike. Four at 10 Hz come to about 30, at 20 Hz to 19. There a limit of 16 starts
processes, which take a tenth more CPU and gain little time. Eight at 20 Hz come to 41 and want
processes: a limit of 64 takes a tenth less CPU but a fifth more time than 16 or 32. With cameras
the thread is not used.
"""


class ThreadFirst(Executor):
    """A thread that works, and a pool of processes once more waits than it gets done.

    For work that takes little more than writing files. A process of its own has to load again what
    this one has, which takes more CPU than such work on a short recording.

    Args:
        start: starts the pool.
        most_waiting: tasks in the thread's queue, the one under way included.
    """

    def __init__(self, start: Callable[[], ProcessPool], most_waiting: int = MOST_WAITING) -> None:
        self._start = start
        self._most_waiting = most_waiting
        # Entered again by a task that is done before somebody asks to be told.
        self._lock = threading.RLock()
        self._waiting = 0
        self._processes: ProcessPool | None = None
        self._thread = ThreadPoolExecutor(1, "conversion", initializer=_lower_priority)
        self._thread.submit(import_libraries, pictures=False)

    def submit(
        self,
        fn: Callable[_Parameters, _Result],
        /,
        *args: _Parameters.args,
        **kwargs: _Parameters.kwargs,
    ) -> Future[_Result]:
        """Queue a task.

        Raises:
            BrokenPoolError: a process of the pool has died, or all were ended.
        """
        with self._lock:
            if self._processes is None and self._waiting >= self._most_waiting:
                self._processes = self._start()
            if self._processes is not None:
                return self._processes.submit(fn, *args, **kwargs)
            try:
                task = self._thread.submit(fn, *args, **kwargs)
            except RuntimeError as error:
                raise BrokenPoolError("The thread has ended; it takes no work any more.") from error
            self._waiting += 1
            task.add_done_callback(self._note_done)
            return task

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """See ``ProcessPool.shutdown``."""
        self._thread.shutdown(wait, cancel_futures=cancel_futures)
        if self._processes is not None:
            self._processes.shutdown(wait, cancel_futures=cancel_futures)

    def kill(self) -> None:
        """End processes in the middle of their tasks, and the thread after its own."""
        if self._processes is not None:
            self._processes.kill()
        self._thread.shutdown(wait=True, cancel_futures=True)

    def _note_done(self, task: Future[Any]) -> None:
        with self._lock:
            self._waiting -= 1


def _lower_priority() -> None:
    """Take what the simulator leaves, as processes that convert do."""
    os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
