"""Ctrl-C and SIGTERM: the first asks the run to end well, the second ends it at once."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType, TracebackType

from carstage.runs.wakeup_pipe import WakeupPipe

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
EXIT_CODE = 130
END_S = 10.0
"""A run ends within so many seconds of the first signal."""
ANSWER_S = 4.0
"""So many of them are left when a store that does not answer is waited for no longer."""
LAST_ANSWER_S = 1.5
"""The same, once all else has ended and only what was begun is to be kept or removed."""
GIVE_BACK_S = 5.0
"""So many of them are for a recorder to give back what it holds on somebody else's server."""


class Interruption:
    """Takes the signals while it is entered; outside the main thread it takes none.

    The first signal raises ``KeyboardInterrupt`` where the program waits for something that may be
    cut, such as a server's start; inside ``deferred`` it only sets ``requested`` and wakes
    ``fileno``. The second one kills what the run waits for and ends the process; an interactive
    session, such as a notebook's, stays and gets ``KeyboardInterrupt``.

    Args:
        notify: called with a sentence for the user at the first signal.
        end_s: seconds from the first signal in which all has to end.
    """

    def __init__(
        self, notify: Callable[[str], None] = lambda _: None, *, end_s: float = END_S
    ) -> None:
        self.requested = False
        self._within_s = end_s
        self._end_s = float("inf")
        self._notify = notify
        self._deferring = 0
        self._killers: list[Callable[[], None]] = []
        self._previous: dict[int, signal.Handlers | int | Callable[..., object] | None] = {}
        self._wakeup = WakeupPipe()

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            for number in _SIGNALS:
                if number == signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
                    continue  # nohup: the run outlives its terminal
                self._previous[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._previous.items():
            if handler is not None:  # else: not set from Python, and so not to be set back
                signal.signal(number, handler)
        self._wakeup.close()

    def fileno(self) -> int:
        """A descriptor that becomes readable when a signal came, for ``selectors``."""
        return self._wakeup.fileno()

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """A stretch that a signal does not cut; look at ``requested`` in it."""
        self._deferring += 1
        try:
            yield
        finally:
            self._deferring -= 1

    @contextmanager
    def kills(self, killer: Callable[[], None]) -> Iterator[None]:
        """A stretch in which the second signal calls ``killer`` before it ends the process."""
        self._killers.append(killer)
        try:
            yield
        finally:
            self._killers.remove(killer)

    @property
    def left_s(self) -> float:
        """Seconds until the run should have ended; infinite before the first signal."""
        return self._end_s - time.monotonic()

    def left_before_s(self, reserve_s: float) -> float:
        """Seconds until only ``reserve_s`` are left."""
        return self.left_s - reserve_s

    def check(self) -> None:
        """Raise ``KeyboardInterrupt`` when a signal came in a deferred stretch."""
        if self.requested:
            raise KeyboardInterrupt

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            for killer in self._killers:
                with suppress(OSError):
                    killer()
            if hasattr(sys, "ps1"):  # only interactive sessions have a prompt
                raise KeyboardInterrupt
            os._exit(EXIT_CODE)
        self.requested = True
        self._end_s = time.monotonic() + self._within_s
        self._wakeup.notify()
        self._notify(f"Ending within {self._within_s:.0f} s; press Ctrl-C again to end at once.")
        if not self._deferring:
            raise KeyboardInterrupt
