"""Pieces of work of one tick that are done side by side, with results as they come."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
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
    ) -> Iterator[tuple[int, _Result]]:
        """What the pieces return, with their numbers, as it comes; others are done meanwhile.

        Pieces are begun in their order. When it ends, none of them is being done any more.

        Args:
            pieces: the work.
            begun: called when the first are begun.

        Raises:
            Exception: what a piece raised.
        """
        if self._pool is None or len(pieces) < 2:
            begun()
            for number, piece in enumerate(pieces):
                yield number, piece.work()
            return
        left, under_way = deque(enumerate(pieces)), dict[Future[_Result], int]()
        try:
            self._begin(left, under_way, pieces)
            begun()
            while left or under_way:
                if left and not left[0][1].beside:
                    number, piece = left.popleft()
                    yield number, piece.work()
                else:
                    for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                        yield under_way.pop(future), future.result()
                self._begin(left, under_way, pieces)
        finally:
            wait([future for future in under_way if not future.cancel()])

    def _begin(
        self,
        left: deque[tuple[int, Piece[_Result]]],
        under_way: dict[Future[_Result], int],
        pieces: Sequence[Piece[_Result]],
    ) -> None:
        """Begin as many of the pieces that are left as there is room for."""
        assert self._pool is not None
        pixels = sum(pieces[number].pixels for number in under_way.values())
        while left and left[0][1].beside:
            if under_way and pixels + left[0][1].pixels > _MOST_PIXELS:
                return
            number, piece = left.popleft()
            under_way[self._pool.submit(piece.work)] = number
            pixels += piece.pixels
