"""The thread that draws, while the world's thread goes on."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import ParamSpec, TypeVar

logger = logging.getLogger(__name__)

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
        self._changed = threading.Condition()
        self._undone = 0
        self._put_off: deque[Callable[[], None]] = deque()
        self._begun_put_off = False
        self._leaves_out = False
        self._held = False

    @property
    def busy(self) -> bool:
        """Whether something that was handed over is not finished."""
        return self._undone > 0

    def submit(
        self,
        work: Callable[_Parameters, _Result],
        /,
        *args: _Parameters.args,
        **kwargs: _Parameters.kwargs,
    ) -> Future[_Result]:
        """Hand work over; waits only if far too much is waiting already."""

        def counted() -> _Result:
            try:
                return work(*args, **kwargs)
            finally:
                self._count(-1)

        self._room.acquire()
        self._count(+1)
        future = self._pool.submit(counted)
        future.add_done_callback(lambda _: self._room.release())
        return future

    def put_off(self, work: Callable[[], None]) -> None:
        """Hand work over that comes after all other work, also after what is submitted later.

        Other work waits for one piece of it at most: for the one that is being done.
        """
        with self._changed:
            self._undone += 1
            self._put_off.append(work)
            self._begin_one_put_off()

    def hold(self, *, held: bool) -> None:
        """Whether nothing more of what is put off is begun for now."""
        with self._changed:
            self._held = held
            self._begin_one_put_off()

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
        with self._changed:
            self._held = False
            self._begin_one_put_off()
            self._changed.wait_for(lambda: not self._undone)

    def finish_without_what_is_put_off(self) -> None:
        """Wait until everything is done; what is put off and not begun is left out."""
        with self._changed:
            self._leaves_out, self._held = True, False
            self._begin_one_put_off()
            self._changed.wait_for(lambda: not self._undone)
            self._leaves_out = False

    def close(self) -> None:
        """End the thread when everything is done; what is put off and not begun is left out."""
        self.finish_without_what_is_put_off()
        self._pool.shutdown()

    def _begin_one_put_off(self) -> None:
        """Queue one piece of what is put off, behind what was submitted. The lock is held."""
        if self._put_off and not self._held and not self._begun_put_off:
            self._begun_put_off = True
            self._pool.submit(self._do_one_put_off)

    def _do_one_put_off(self) -> None:
        with self._changed:
            if self._held:  # since it was queued
                self._begun_put_off = False
                return
            work = None if self._leaves_out else self._put_off[0]
        if work is not None:
            try:
                work()
            except Exception:
                logger.exception("what was put off failed")
        with self._changed:
            self._put_off.popleft()
            self._undone -= 1
            self._begun_put_off = False
            self._begin_one_put_off()
            self._changed.notify_all()

    def _count(self, change: int) -> None:
        with self._changed:
            self._undone += change
            self._changed.notify_all()
