"""Processes that work: few threads each, deaf to Ctrl-C, gone when their caller is gone.

``concurrent.futures.ProcessPoolExecutor`` is not used: its processes import the caller's main
module, so that a script without ``if __name__ == "__main__"`` would start itself again and again,
and a program on standard input could not use it at all.
"""

from __future__ import annotations

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

from carstage.processes.worker import ENVIRONMENT, FORK, FORKED, KILL, LENGTH

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")

_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[2:]; "
    "from carstage.processes.worker import fork_workers; fork_workers(int(sys.argv[1]))"
)
"""Modules are looked for where the caller looks for them, and nowhere before that is known."""


class BrokenPoolError(BrokenExecutor):
    """A worker died, for example for lack of memory; its pool takes no work any more."""


class _RemoteTracebackError(Exception):
    """The cause of an error that a worker raised: shows where it was raised."""

    def __str__(self) -> str:
        return f"\n{self.args[0]}"


Preload = tuple[Callable[..., object], tuple[Any, ...]]
"""A function and its arguments; both can be pickled."""


def process_pool(workers: int | None = None, *, preload: Preload = (bool, ())) -> ProcessPool:
    """Processes for tasks of Python code; the caller shuts the executor down.

    One process is started at once, as a program of its own: it is not forked from the caller, who
    may have threads, and never imports the caller's main module. It calls ``preload``, and the
    workers are forked from it. All ignore SIGINT and SIGTERM, so that the caller alone decides what
    they mean, run at a lower priority than the simulator, and end when the caller dies, however it
    does. Functions and arguments of tasks must be picklable and defined in importable modules.

    Args:
        workers: number of processes; default: the number of usable CPU cores. Each is forked when
            a task finds no idle one.
        preload: called once, before the first task: what it imports, no worker has to. It must
            start no thread.
    """
    return ProcessPool(workers or len(os.sched_getaffinity(0)), preload)


class ProcessPool(Executor):
    """What :func:`process_pool` gives.

    As many threads as processes; each hands a task to an idle process and waits for the answer.

    The threads give queueing, cancelling and shutting down; the processes do the work.
    """

    def __init__(self, workers: int, preload: Preload) -> None:
        self._threads = ThreadPoolExecutor(workers, thread_name_prefix="pool")
        self._lock = threading.Lock()
        self._parent = _Parent(preload)
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
            self._parent.end()

    def kill(self) -> None:
        """End the workers at once, in the middle of their tasks; it takes no work any more."""
        self._threads.shutdown(wait=False, cancel_futures=True)  # before a thread takes the next
        self._break()
        self.shutdown(wait=True)

    def _work(self, function: Callable[..., Any], arguments: Any, keywords: Any) -> Any:
        task = pickle.dumps((function, arguments, keywords))
        try:
            worker = self._take()
            succeeded, result, trace = worker.ask(task)
        except (EOFError, ConnectionError, pickle.UnpicklingError) as error:
            self._break()
            raise BrokenPoolError("A process of the pool died.") from error
        with self._lock:
            self._idle.append(worker)
        if not succeeded:
            raise result from _RemoteTracebackError(trace)
        return result

    def _take(self) -> _Worker:
        """An idle worker, or a new one.

        Raises:
            BrokenPoolError: it takes no work any more.
            EOFError, OSError: the process that would be forked is gone.
            OSError: the system has no room for one more.
        """
        with self._lock:
            self._require_whole()
            if self._idle:
                return self._idle.popleft()
        # Without the lock: the first fork waits until the libraries are loaded.
        worker = _Worker(self._parent.fork())
        with self._lock:
            self._workers.append(worker)
        return worker

    def _break(self) -> None:
        """Take no work any more and end all workers: a lack of memory is not theirs alone."""
        self._broken = True
        self._parent.kill()

    def _require_whole(self) -> None:
        if self._broken:
            raise BrokenPoolError("A process of the pool died; it takes no work any more.")


class _Parent:
    """The process that workers are forked from, started at once."""

    def __init__(self, preload: Preload) -> None:
        self._control, theirs = socket.socketpair()
        self._lock = threading.Lock()
        self._has_forked = False
        with theirs:
            # A child inherits the blocked signals: none reaches it, not even before it can decide
            # to ignore it. Who ends a service or a job sends SIGTERM to all of its processes.
            ours = (signal.SIGINT, signal.SIGHUP, signal.SIGTERM)
            before = signal.pthread_sigmask(signal.SIG_BLOCK, ours)
            try:
                self._process = subprocess.Popen(
                    [sys.executable, "-c", _PROGRAM, str(theirs.fileno()), *sys.path],
                    stdin=subprocess.DEVNULL,
                    pass_fds=(theirs.fileno(),),
                    env={**os.environ, **ENVIRONMENT},
                )
            except BaseException:
                self._control.close()
                raise
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
        task = pickle.dumps(preload)
        with suppress(OSError):  # it is gone already: the first fork will tell
            self._control.sendall(LENGTH.pack(len(task)) + task)

    def fork(self) -> socket.socket:
        """The other end of a new worker's socket; waits until what it needs is loaded.

        Raises:
            EOFError, ConnectionError: the process is gone.
            OSError: the system has no room for another.
        """
        ours, theirs = socket.socketpair()
        try:
            with theirs, self._lock:
                socket.send_fds(self._control, [FORK], [theirs.fileno()])
                answer = self._control.recv(FORKED.size)
                if len(answer) < FORKED.size:
                    raise EOFError
                self._has_forked = True
            (failure,) = FORKED.unpack(answer)
            if failure:
                raise OSError(failure, os.strerror(failure))
        except BaseException:
            ours.close()
            raise
        return ours

    def kill(self) -> None:
        """End it and all workers at once."""
        if not self._has_forked:  # it may still be loading, and hears nothing
            self._process.kill()
            return
        with suppress(OSError):  # it is gone, and its workers with it
            self._control.sendall(KILL)

    def end(self) -> None:
        """End it, and wait for its workers to end."""
        self._control.close()
        self._process.wait()


class _Worker:
    """One process that works.

    Args:
        connection: our end of its socket.
    """

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._stream = connection.makefile("rwb")

    def ask(self, task: bytes) -> tuple[bool, Any, str]:
        """The answer to a task.

        Raises:
            EOFError, OSError: the process is gone.
        """
        pickle.dump(task, self._stream)
        self._stream.flush()
        answer: tuple[bool, Any, str] = pickle.loads(pickle.load(self._stream))
        return answer

    def end(self) -> None:
        """Let it end; it has no task."""
        with self._socket, suppress(OSError):  # it is gone already: a task could not be sent
            self._stream.close()
