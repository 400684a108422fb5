"""The slot's end of the line to its run: standard input and output, taken over."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

from carstage.errors import CarStageError, WorkerLostError
from carstage.execution.slots import LineBuffer

_READ_BYTES = 1 << 16


class SlotLine:
    """Hears and tells; a thread reads, so that the run never waits for a slot to listen.

    What comes is bounded by the protocol: a slot has asked for each job. When the line breaks
    before the run has said ``end``, the slot's process gets SIGINT, as by Ctrl-C.

    Standard output becomes standard error: nothing that a library or a child prints gets into the
    line.
    """

    def __init__(self) -> None:
        # Whoever has started it may ignore or block the signal, as Ray's processes do.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
        self._output = os.dup(sys.stdout.fileno())  # no child inherits it
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        self._lock = threading.Lock()
        self._messages = SimpleQueue[dict[str, Any]]()
        self._notify: Callable[[], None] = lambda: None
        self._over = False
        threading.Thread(target=self._read, name="slot-line", daemon=True).start()

    def notifies(self, notify: Callable[[], None]) -> None:
        """From now on call ``notify``, from another thread, whenever a message has come."""
        self._notify = notify
        notify()

    def next(self) -> dict[str, Any]:
        """The next message; waits for it."""
        return self._messages.get()

    def received(self) -> list[dict[str, Any]]:
        """The messages that have come."""
        return [self._messages.get() for _ in range(self._messages.qsize())]

    def send(self, what: str, **fields: Any) -> None:
        """Tell the run something; from any thread.

        Raises:
            WorkerLostError: the run is gone.
        """
        data = (json.dumps({"say": what, **fields}, ensure_ascii=False) + "\n").encode()
        with self._lock:
            try:
                while data:
                    data = data[os.write(self._output, data) :]
            except OSError as error:
                raise WorkerLostError("The run of this worker is gone.") from error

    def send_error(self, error: CarStageError) -> None:
        """Tell what ends the run."""
        kind = type(error)
        while kind.__module__ != CarStageError.__module__:  # of a module of its own
            kind = kind.__mro__[1]
        self.send("error", kind=kind.__name__, message=error.message, hint=error.hint)

    def _read(self) -> None:
        buffer = LineBuffer()
        while data := os.read(sys.stdin.fileno(), _READ_BYTES):
            for message in buffer.messages(data):
                self._over = self._over or "end" in message
                self._messages.put(message)
            self._notify()
        if not self._over:
            os.kill(os.getpid(), signal.SIGINT)
