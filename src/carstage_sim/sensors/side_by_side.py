"""Pieces of work that are done side by side, those of one tick while the last one's end."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from typing import Generic, TypeVar

_MOST_AT_ONCE = 8
_MOST_PIXELS = 2_000_000
"""Of pictures that are made at once; a larger one is made alone, whatever its size."""

_Result = TypeVar("_Result")


@dataclass(frozen=True, slots=True)
class Piece:
    """Something to do.

    Attributes:
        work: does it.
        line: what it belongs to: pieces of one line are done one after the other.
        pixels: how many it holds in memory meanwhile.
        beside: whether it may be done in another thread, while others are.
    """

    work: Callable[[], None]
    line: Hashable
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
        self._lock = threading.Lock()

    def __call__(self) -> _Result:
        """It."""
        with self._lock:
            if self._make is not None:
                self._made.append(self._make())
                self._make = None
        return self._made[0]


def all_done(futures: Sequence[Future[None]]) -> Future[None]:
    """A future that is done when all are, with the first error of theirs in their order."""
    together: Future[None] = Future()
    left = len(futures)
    lock = threading.Lock()

    def one_done(_: Future[None]) -> None:
        nonlocal left
        with lock:
            left -= 1
            if left:
                return
        errors = [error for future in futures if (error := future.exception()) is not None]
        if errors:
            together.set_exception(errors[0])
        else:
            together.set_result(None)

    if not futures:
        together.set_result(None)
    for future in futures:
        future.add_done_callback(one_done)
    return together


class SideBySide:
    """Threads for pieces of work that wait for others most of the time.

    One thread at a time hands pieces over.

    Args:
        at_once: pieces at the same time, at most eight; with one the caller does them.
    """

    def __init__(self, at_once: int) -> None:
        self._pool = (
            ThreadPoolExecutor(min(at_once, _MOST_AT_ONCE), thread_name_prefix="sensors")
            if at_once > 1
            else None
        )
        self._changed = threading.Condition()
        self._pixels: dict[Future[None], int] = {}
        self._last: dict[Hashable, Future[None]] = {}

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()

    def begin(
        self, pieces: Sequence[Piece], begun: Callable[[], None] = lambda: None
    ) -> Future[None]:
        """Begin pieces in their order, while those of earlier calls may not be done yet.

        Returns when all are with their threads: those that may not be done beside others are done
        here, in their turn.

        Args:
            pieces: the work.
            begun: called when the first are begun.

        Returns:
            What is done when all pieces are, with the first error of theirs.
        """
        futures: list[Future[None]] = []
        told = False
        for piece in pieces:
            beside = self._pool is not None and piece.beside
            if not told and not (beside and self._has_room(piece.pixels)):
                told = True
                begun()
            futures.append(self._handed_over(piece) if beside else self._done_here(piece))
        if not told:
            begun()
        return all_done(futures)

    def wait_for(self, line: Hashable) -> None:
        """Wait until the pieces of a line that were handed over are done."""
        if (last := self._last.get(line)) is not None:
            wait([last])

    def wait_for_all(self) -> None:
        """Wait until all that was handed over is done."""
        with self._changed:
            self._changed.wait_for(lambda: not self._pixels)

    def _has_room(self, pixels: int) -> bool:
        with self._changed:
            return not self._pixels or sum(self._pixels.values()) + pixels <= _MOST_PIXELS

    def _handed_over(self, piece: Piece) -> Future[None]:
        assert self._pool is not None
        with self._changed:
            self._changed.wait_for(lambda: self._has_room(piece.pixels))
            # Those before it are in front of it in the pool's queue: they never wait for it.
            before = self._last.get(piece.line)
            future = self._pool.submit(partial(_after, before, piece.work))
            self._pixels[future] = piece.pixels
            self._last[piece.line] = future
        future.add_done_callback(partial(self._forget, piece.line))
        return future

    def _forget(self, line: Hashable, future: Future[None]) -> None:
        with self._changed:
            del self._pixels[future]
            if self._last.get(line) is future:
                del self._last[line]
            self._changed.notify_all()

    def _done_here(self, piece: Piece) -> Future[None]:
        self.wait_for(piece.line)
        future: Future[None] = Future()
        try:
            piece.work()
        except Exception as error:  # noqa: BLE001 - raised where the result is asked for
            future.set_exception(error)
        else:
            future.set_result(None)
        return future


def _after(before: Future[None] | None, work: Callable[[], None]) -> None:
    if before is not None:
        wait([before])
    work()
