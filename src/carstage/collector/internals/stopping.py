"""The request to end: set by signals, by a closed pipe, seen between two ticks."""

from __future__ import annotations

import os
import signal
import threading
from typing import Any, Optional

from carstage.collector.internals.errors import InterruptedByRequestError


class StopRequest:
    """A flag with a reason; the main thread looks at it between steps that must not be cut."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self._reason = ""

    @property
    def requested(self) -> bool:
        """Whether somebody asked to end."""
        return self._event.is_set()

    def request(self, reason: str) -> None:
        """Ask to end; the first reason stays."""
        if not self._event.is_set():
            self._reason = reason
            self._event.set()

    def check(self) -> None:
        """Raise when somebody asked to end.

        Raises:
            InterruptedByRequestError: with the reason.
        """
        if self._event.is_set():
            raise InterruptedByRequestError("Recording was ended: %s." % self._reason)

    def wait(self, timeout_s: float) -> bool:
        """Wait until somebody asks to end, at most ``timeout_s``; return whether they did."""
        return self._event.wait(timeout_s)

    def pause(self, seconds: float) -> None:
        """Wait so long.

        Raises:
            InterruptedByRequestError: somebody asked to end meanwhile.
        """
        self._event.wait(seconds)
        self.check()

    def on_signals(self) -> None:
        """Take SIGTERM and SIGINT as requests to end."""

        def handler(number: int, _frame: Any) -> None:
            self.request("by signal %s" % signal.Signals(number).name)

        signal.signal(signal.SIGTERM, handler)
        signal.signal(signal.SIGINT, handler)

    def on_closed_input(self, fd: int) -> threading.Thread:
        """Take the end of input ``fd`` as a request to end: whoever started us is gone."""
        thread = threading.Thread(
            target=self._await_end_of_input, args=(fd,), name="input", daemon=True
        )
        thread.start()
        return thread

    def _await_end_of_input(self, fd: int) -> None:
        error: Optional[OSError] = None
        try:
            while os.read(fd, 4096):
                pass
        except OSError as problem:
            error = problem
        self.request("its standard input closed" if error is None else str(error))
