"""Requests to an object store that whoever waits for them may give up."""

from __future__ import annotations

import math
import os
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from contextlib import contextmanager
from functools import cache
from queue import SimpleQueue
from typing import Any, TypeVar

from carstage.errors import RequestGivenUpError

_LOOK_S = 0.2

Result = TypeVar("Result")
Patience = Callable[[], float]
"""Gives the seconds that are left; it may change its mind while somebody waits."""


def no_end() -> float:
    """The patience of whoever has time."""
    return math.inf


class Requests:
    """Makes requests in threads of their own.

    Compiled code hears no Ctrl-C before its request is answered, or was tried for the last time. So
    the caller only waits for it, which can be interrupted. What nobody waits for any more goes on,
    for a minute and a half at most, but does not keep the process.

    Args:
        root: address of the store, for errors.
    """

    def __init__(self, root: str) -> None:
        self._root = root
        self._patience: Patience = no_end

    @contextmanager
    def within(self, left_s: Patience) -> Iterator[None]:
        """A stretch in which no request is waited for longer than ``left_s`` says, in any thread.

        Stretches lie in one another; the inner one counts.
        """
        outer, self._patience = self._patience, left_s
        try:
            yield
        finally:
            self._patience = outer

    def answer(self, request: Callable[[], Result]) -> Result:
        """The answer to a request.

        Raises:
            RequestGivenUpError: it has not come in time; it may have been carried out.
        """
        asked = _threads(os.getpid()).submit(request)
        while not wait([asked], max(0.0, min(_LOOK_S, self._patience()))).done:
            self._refuse_to_wait()
        return asked.result()

    def pause(self, seconds: float) -> None:
        """Wait between two tries.

        Raises:
            RequestGivenUpError: the time was over before.
        """
        over = threading.Event()
        while seconds > 0 and not over.wait(min(_LOOK_S, seconds)):
            seconds -= _LOOK_S
            self._refuse_to_wait()

    def _refuse_to_wait(self) -> None:
        if self._patience() <= 0:
            raise RequestGivenUpError(
                f"{self._root}: the store has not answered by the end of the run.",
                "See that the store is up; the same command again continues.",
            )


class _Threads:
    """Threads that end with the process, whatever they do; as many as are needed at a time."""

    def __init__(self) -> None:
        self._idle: deque[SimpleQueue[tuple[Callable[[], Any], Future[Any]]]] = deque()

    def submit(self, task: Callable[[], Result]) -> Future[Result]:
        """Do a task at once."""
        future: Future[Result] = Future()
        try:
            inbox = self._idle.pop()
        except IndexError:
            inbox = SimpleQueue()
            name = "object-store"
            threading.Thread(target=self._serve, args=(inbox,), name=name, daemon=True).start()
        inbox.put((task, future))
        return future

    def _serve(self, inbox: SimpleQueue[tuple[Callable[[], Any], Future[Any]]]) -> None:
        while True:
            self._do(*inbox.get(), inbox)

    def _do(
        self,
        task: Callable[[], Any],
        future: Future[Any],
        inbox: SimpleQueue[tuple[Callable[[], Any], Future[Any]]],
    ) -> None:
        try:
            result = task()
        except BaseException as error:  # noqa: BLE001 - it is raised where it is waited for
            self._idle.append(inbox)  # first, so that who asks next finds it
            future.set_exception(error)
        else:
            self._idle.append(inbox)
            future.set_result(result)


@cache
def _threads(pid: int) -> _Threads:
    """Those of a process: a forked one has none of its parent's."""
    del pid
    return _Threads()
