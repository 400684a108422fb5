"""Other threads, and handlers of signals, wake the one that waits in a selector."""

from __future__ import annotations

import os
from contextlib import suppress


class WakeupPipe:
    """Readable for ``selectors`` from its ring until it is silenced; a context manager.

    Nobody may ring any more when its block ends.
    """

    def __init__(self) -> None:
        self._descriptor = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)

    def __enter__(self) -> WakeupPipe:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the descriptor back."""
        os.close(self._descriptor)

    def fileno(self) -> int:
        """The descriptor."""
        return self._descriptor

    def notify(self) -> None:
        """Wake who waits, now or when they begin to; from any thread."""
        os.eventfd_write(self._descriptor, 1)

    def clear(self) -> None:
        """Forget the rings so far."""
        with suppress(BlockingIOError):  # there were none
            os.eventfd_read(self._descriptor)
