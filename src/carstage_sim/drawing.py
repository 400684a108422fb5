"""The thread that draws, while the world's thread goes on."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, ParamSpec, TypeVar

_MOST_WAITING = 64

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


class DrawingThread:
    """Does what it is handed, one after the other.

    What is handed over must not change afterwards. While it has nothing to do, whoever hands work
    over may do such work himself.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="drawing")
        self._room = threading.BoundedSemaphore(_MOST_WAITING)
        self._last: Future[Any] | None = None

    @property
    def busy(self) -> bool:
        """Whether something that was handed over is not finished."""
        return self._last is not None and not self._last.done()

    def submit(
        self,
        work: Callable[_Parameters, _Result],
        /,
        *args: _Parameters.args,
        **kwargs: _Parameters.kwargs,
    ) -> Future[_Result]:
        """Hand work over; waits only if far too much is waiting already."""
        self._room.acquire()
        future = self._pool.submit(work, *args, **kwargs)
        future.add_done_callback(lambda _: self._room.release())
        self._last = future
        return future

    def at_once_or_later(
        self,
        work: Callable[_Parameters, _Result],
        /,
        *args: _Parameters.args,
        **kwargs: _Parameters.kwargs,
    ) -> Future[_Result]:
        """Do the work here if the thread has nothing to do, else hand it over."""
        if self.busy:
            return self.submit(work, *args, **kwargs)
        done: Future[_Result] = Future()
        try:
            done.set_result(work(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - raised where the result is asked for
            done.set_exception(error)
        return done

    def finish(self) -> None:
        """Wait until everything is done."""
        if self._last is not None:
            self._last.exception()

    def close(self) -> None:
        """End the thread when everything is done."""
        self._pool.shutdown()
