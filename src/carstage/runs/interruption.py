"""Ctrl-C and SIGTERM: the first asks the run to end well, the second ends it at once."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType, TracebackType

from carstage.runs.wakeup_pipe import WakeupPipe

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
EXIT_CODE = 130


class Interruption:
    """Takes the signals while it is entered; outside the main thread it takes none.

    The first signal raises ``KeyboardInterrupt`` where the program waits for something that may be
    cut, such as a server's start; inside ``held`` it only sets ``requested`` and wakes ``fileno``.

    Args:
        notify: told a sentence for the user at the first signal.
    """

    def __init__(self, notify: Callable[[str], None] = lambda _: None) -> None:
        self.requested = False
        self._notify = notify
        self._held = 0
        self._killers: list[Callable[[], None]] = []
        self._previous: dict[int, object] = {}
        self._wakeup = WakeupPipe()

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            for number in _SIGNALS:
                self._previous[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._wakeup.close()

    def fileno(self) -> int:
        """A descriptor that becomes readable when a signal came, for ``selectors``."""
        return self._wakeup.fileno()

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """A stretch that a signal does not cut; look at ``requested`` in it."""
        self._held += 1
        try:
            yield
        finally:
            self._held -= 1

    @contextmanager
    def kills(self, killer: Callable[[], None]) -> Iterator[None]:
        """A stretch in which the second signal calls ``killer`` before it ends the process."""
        self._killers.append(killer)
        try:
            yield
        finally:
            self._killers.remove(killer)

    def check(self) -> None:
        """Raise ``KeyboardInterrupt`` when a signal came while it was held."""
        if self.requested:
            raise KeyboardInterrupt

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            for killer in self._killers:
                with suppress(OSError):
                    killer()
            os._exit(EXIT_CODE)
        self.requested = True
        self._wakeup.notify()
        self._notify("Ending after this frame; press Ctrl-C again to end at once.")
        if not self._held:
            raise KeyboardInterrupt
