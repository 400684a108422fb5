"""The processes that convert: few threads each, deaf to Ctrl-C, gone when their parent is gone.

``concurrent.futures.ProcessPoolExecutor`` is not used: its processes import the caller's main
module, so that a script without ``if __name__ == "__main__"`` would start itself again and again,
and a program on standard input could not use it at all.
"""

from __future__ import annotations

import gc
import importlib
import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from typing import Any, ParamSpec, TypeVar

from carstage.conversion.worker import THREAD_LIMITS

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")

_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[2:]; "
    "from carstage.conversion.worker import serve; serve(int(sys.argv[1]))"
)
"""Modules are looked for where the caller looks for them, and nowhere before that is known."""


class BrokenPoolError(BrokenExecutor):
    """A worker died, for example for lack of memory; its pool takes no work any more."""


class _RemoteTracebackError(Exception):
    """The cause of an error that a worker raised: shows where it was raised."""

    def __str__(self) -> str:
        return f"\n{self.args[0]}"


def conversion_pool(workers: int | None = None) -> ConversionPool:
    """Processes for ``EpisodeConversion``; the caller shuts the executor down.

    The workers are started as programs of their own, not forked (the caller may have threads), and
    never import the caller's main module. They ignore SIGINT, so that the caller alone decides what
    Ctrl-C means, run at a lower priority than the simulator, and end when the caller dies, however
    it does. Functions and arguments of tasks must be picklable and defined in importable modules.

    Args:
        workers: number of processes; default: the number of usable CPU cores. Each is started when
            a task finds no idle one.
    """
    return ConversionPool(workers or len(os.sched_getaffinity(0)))


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


class ConversionPool(Executor):
    """What :func:`conversion_pool` gives.

    As many threads as processes; each hands a task to an idle process and waits for the answer.

    The threads give queueing, cancelling and shutting down; the processes do the work.
    """

    def __init__(self, workers: int) -> None:
        self._threads = ThreadPoolExecutor(workers, thread_name_prefix="conversion")
        self._lock = threading.Lock()
        self._workers: list[_Worker] = []
        self._idle: deque[_Worker] = deque()
        self._broken = False

    def submit(
        self,
        fn: Callable[_Parameters, _Result],
        /,
        *args: _Parameters.args,
        **kwargs: _Parameters.kwargs,
    ) -> Future[_Result]:
        """Queue a task.

        Raises:
            BrokenPoolError: a worker has died.
        """
        self._require_whole()
        return self._threads.submit(self._work, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the workers when their tasks are done; without ``wait``, when this process ends."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        if wait:
            for worker in self._workers:
                worker.end()

    def kill(self) -> None:
        """End the workers at once, in the middle of their tasks; it takes no work any more."""
        self._break()
        self.shutdown(wait=True, cancel_futures=True)

    def _work(self, function: Callable[..., Any], arguments: Any, keywords: Any) -> Any:
        task = pickle.dumps((function, arguments, keywords))
        worker = self._take()
        try:
            succeeded, result, trace = worker.ask(task)
        except (EOFError, OSError, pickle.UnpicklingError) as error:
            self._break()
            raise BrokenPoolError("A process of the pool died.") from error
        with self._lock:
            self._idle.append(worker)
        if not succeeded:
            raise result from _RemoteTracebackError(trace)
        return result

    def _take(self) -> _Worker:
        with self._lock:
            self._require_whole()
            if self._idle:
                return self._idle.popleft()
            worker = _Worker()
            self._workers.append(worker)
            return worker

    def _break(self) -> None:
        """Take no work any more and end all workers: a lack of memory is not theirs alone."""
        with self._lock:
            self._broken = True
            for worker in self._workers:
                worker.kill()

    def _require_whole(self) -> None:
        if self._broken:
            raise BrokenPoolError("A process of the pool died; it takes no work any more.")


class _Worker:
    """One process, started at once."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            # A child inherits the blocked signals: Ctrl-C reaches it not even before it can decide
            # to ignore it.
            before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
            try:
                self._process = subprocess.Popen(
                    [sys.executable, "-c", _PROGRAM, str(theirs.fileno()), *sys.path],
                    stdin=subprocess.DEVNULL,
                    pass_fds=(theirs.fileno(),),
                    env={**os.environ, **dict.fromkeys(THREAD_LIMITS, "1")},
                )
            except BaseException:
                ours.close()
                raise
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
        self._socket = ours
        self._stream = ours.makefile("rwb")

    def ask(self, task: bytes) -> tuple[bool, Any, str]:
        """The answer to a task.

        Raises:
            EOFError, OSError: the process is gone.
        """
        pickle.dump(task, self._stream)
        self._stream.flush()
        answer: tuple[bool, Any, str] = pickle.loads(pickle.load(self._stream))
        return answer

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()

    def end(self) -> None:
        """End it; it has no task."""
        with self._socket, suppress(OSError):  # it is gone already: a task could not be sent
            self._stream.close()
        self._process.wait()
