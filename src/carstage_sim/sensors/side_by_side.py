"""Pieces of work of one tick that are done side by side, with results in their order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from threading import Lock
from typing import Generic, TypeVar

_MOST_AT_ONCE = 8
_MOST_PIXELS = 2_000_000
"""Of pictures that are made at once; a larger one is made alone, whatever its size."""

_Result = TypeVar("_Result")


@dataclass(frozen=True, slots=True)
class Piece(Generic[_Result]):
    """Something to do.

    Attributes:
        work: does it.
        pixels: how many it holds in memory meanwhile.
        beside: whether it may be done in another thread, while others are.
    """

    work: Callable[[], _Result]
    pixels: int
    beside: bool


class Once(Generic[_Result]):
    """What several threads may ask for and the first of them makes, while the others wait.

    Args:
        make: makes it.
    """

    def __init__(self, make: Callable[[], _Result]) -> None:
        self._make: Callable[[], _Result] | None = make
        self._made: list[_Result] = []
        self._lock = Lock()

    def __call__(self) -> _Result:
        """It."""
        with self._lock:
            if self._make is not None:
                self._made.append(self._make())
                self._make = None
        return self._made[0]


class SideBySide:
    """Threads for pieces of work that wait for others most of the time.

    Args:
        at_once: pieces at the same time, at most eight; one is done by the caller.
    """

    def __init__(self, at_once: int) -> None:
        self._pool = (
            ThreadPoolExecutor(min(at_once, _MOST_AT_ONCE), thread_name_prefix="sensors")
            if at_once > 1
            else None
        )

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()

    def results(
        self, pieces: Sequence[Piece[_Result]], begun: Callable[[], None] = lambda: None
    ) -> Iterator[_Result]:
        """What the pieces return, in their order; those that follow are begun meanwhile.

        When it ends, none of them is being done any more.

        Args:
            pieces: the work.
            begun: called when the first are begun.

        Raises:
            Exception: what a piece raised, in its turn.
        """
        if self._pool is None or len(pieces) < 2:
            begun()
            for piece in pieces:
                yield piece.work()
            return
        futures: deque[Future[_Result] | None] = deque()
        try:
            first, pixels = 0, 0
            for number, piece in enumerate(pieces):
                while first < len(pieces) and (
                    first <= number or pixels + pieces[first].pixels <= _MOST_PIXELS
                ):
                    ahead = pieces[first]
                    futures.append(self._pool.submit(ahead.work) if ahead.beside else None)
                    first, pixels = first + 1, pixels + ahead.pixels
                if not number:
                    begun()
                future = futures.popleft()
                yield piece.work() if future is None else future.result()
                pixels -= piece.pixels
        finally:
            left = [future for future in futures if future is not None and not future.cancel()]
            wait(left)
