"""A thread that does pieces of work, while the world's thread goes on."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Hashable
from concurrent.futures import Future, wait
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, ParamSpec, TypeVar

logger = logging.getLogger(__name__)

_MOST_WAITING = 64
_MOST_RESTS = 1
"""Rests of earlier work that may be left when new work begins beside them."""
_LOOKS_AGAIN_S = 0.02
"""How often it is asked whether what is held has become urgent."""

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


@dataclass(frozen=True, slots=True, eq=False)
class _PutOff:
    """A piece of work that comes after all other; pieces of one line stay in their order."""

    work: Callable[[], None]
    line: Hashable
    urgency: Callable[[], int]
    leave_out: Callable[[], None]


class Begun(NamedTuple):
    """Work that leaves a rest to others.

    Attributes:
        handed_out: done when only the rest is left.
        done: when all is, with the error if there was one.
    """

    handed_out: Future[None]
    done: Future[None]


class WorkThread:
    """Does what it is handed, one after the other.

    What is handed over must not change afterwards. While it has nothing to do, whoever hands work
    over may do such work himself. Work may leave a rest to others: what was begun next in the same
    way may go on beside it, all other work waits for it.

    Args:
        name: what the thread is called.
    """

    def __init__(self, name: str) -> None:
        self._room = threading.BoundedSemaphore(_MOST_WAITING)
        self._changed = threading.Condition()
        self._undone = 0
        self._submitted: deque[Callable[[], None]] = deque()
        self._rests: list[Future[None]] = []
        self._put_off: list[_PutOff] = []
        self._begun: list[_PutOff] = []
        self._leaves_out = False
        self._held = False
        self._closed = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

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

        future: Future[_Result] = Future()

        def done() -> None:
            self._await_rests()
            try:
                result = work(*args, **kwargs)
            except BaseException as error:  # noqa: BLE001 - raised where the result is asked for
                self._done_submitted()
                future.set_exception(error)
            else:
                self._done_submitted()
                future.set_result(result)

        self._submit(done)
        return future

    def begin(self, work: Callable[[], Future[None]]) -> Begun:
        """Hand work over that leaves a rest to others, and returns what is done when that is.

        Waits only if far too much is waiting already.
        """
        begun = Begun(Future(), Future())

        def rest_done(rest: Future[None]) -> None:
            self._done_submitted()
            if (error := rest.exception()) is not None:
                begun.done.set_exception(error)
            else:
                begun.done.set_result(None)

        def begin() -> None:
            self._await_rests(_MOST_RESTS)
            try:
                rest = work()
            except BaseException as error:  # noqa: BLE001 - raised where the result is asked for
                rest = Future()
                rest.set_exception(error)
            self._rests.append(rest)
            begun.handed_out.set_result(None)
            rest.add_done_callback(rest_done)

        self._submit(begin)
        return begun

    def _submit(self, work: Callable[[], None]) -> None:
        self._room.acquire()
        with self._changed:
            self._undone += 1
            self._submitted.append(work)
            self._changed.notify_all()

    def _await_rests(self, but: int = 0) -> None:
        """Wait until no more than some of the rests that earlier work left are not done."""
        while len(self._rests) > but:
            wait([self._rests.pop(0)])

    def put_off(
        self,
        work: Callable[[], None],
        line: Hashable = None,
        urgency: Callable[[], int] = lambda: 0,
        leave_out: Callable[[], None] = lambda: None,
    ) -> None:
        """Hand work over that comes after all other work, also after what is submitted later.

        Other work waits until a piece that is being done calls :meth:`give_way`, or is done.

        Args:
            work: what is done.
            line: pieces of one line are done in their order.
            urgency: a line with more comes before others; one with none waits while held.
            leave_out: called instead if it is left out in the end.
        """
        with self._changed:
            self._undone += 1
            self._put_off.append(_PutOff(work, line, urgency, leave_out))
            self._changed.notify_all()

    def give_way(self) -> None:
        """To be called now and then by a piece that was put off: what comes first is done here.

        While what is put off is held, a piece that is not urgent waits here.
        """
        while (work := self._what_comes_first()) is not None:
            work()

    def hold(self, *, held: bool) -> None:
        """Whether nothing more of what is put off is begun for now but what is urgent."""
        with self._changed:
            if held != self._held:
                self._held = held
                self._changed.notify_all()

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
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self._undone)

    def finish_without_what_is_put_off(self) -> None:
        """Wait until everything is done; what is put off and not begun is left out."""
        with self._changed:
            self._leaves_out, self._held = True, False
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self._undone)
            self._leaves_out = False

    def close(self) -> None:
        """End the thread when everything is done; what is put off and not begun is left out."""
        self.finish_without_what_is_put_off()
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while (work := self._next()) is not None:
            work()

    def _next(self) -> Callable[[], None] | None:
        """What is done next; None at the end."""
        with self._changed:
            while not self._closed:
                if self._submitted:
                    return self._submitted.popleft()
                if (one := self._next_put_off(-1 if not self._held else 0)) is not None:
                    return partial(self._do_put_off, one)
                # What is urgent may change while nobody tells.
                self._changed.wait(_LOOKS_AGAIN_S if self._put_off else None)
        return None

    def _what_comes_first(self) -> Callable[[], None] | None:
        """What is done before the piece that is being done goes on, None when that may."""
        with self._changed:
            while self._begun:
                if self._submitted:
                    return partial(self._aside, self._submitted.popleft())
                urgency = self._begun[-1].urgency()
                if (one := self._next_put_off(urgency)) is not None:
                    return partial(self._do_put_off, one)
                if not self._held or self._leaves_out or urgency > 0:
                    break
                self._changed.wait(_LOOKS_AGAIN_S)
        return None

    def _next_put_off(self, above: int) -> _PutOff | None:
        """The most urgent of what is put off, if it is more so. The lock is held."""
        first: dict[Hashable, _PutOff] = {}
        for one in self._put_off:
            first.setdefault(one.line, one)
        for one in self._begun:
            first.pop(one.line, None)
        urgency = {one: one.urgency() for one in first.values()}
        chosen = max(urgency, key=urgency.__getitem__, default=None)
        if chosen is None or urgency[chosen] <= above:
            return None
        self._put_off.remove(chosen)
        return chosen

    def _aside(self, work: Callable[[], None]) -> None:
        """Do other work as if no piece that was put off were being done."""
        begun, self._begun = self._begun, []
        try:
            work()
            self._await_rests()
        finally:
            self._begun = begun

    def _do_put_off(self, one: _PutOff) -> None:
        self._await_rests()
        self._begun.append(one)
        try:
            (one.leave_out if self._leaves_out else one.work)()
        except Exception:
            logger.exception("what was put off failed")
        self._begun.pop()
        self._count_done()

    def _done_submitted(self) -> None:
        self._room.release()
        self._count_done()

    def _count_done(self) -> None:
        with self._changed:
            self._undone -= 1
            self._changed.notify_all()
