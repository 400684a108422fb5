"""Log lines about misbehaving clients, few of them however often it happens."""

from __future__ import annotations

import logging
import threading
import time

_AGAIN_AFTER_S = 10.0


class ThrottledWarnings:
    """Warns of each kind of trouble at once, then at most once in ten seconds, with a count.

    Args:
        logger: where the warnings go.
        again_after_s: how long further trouble of a kind is only counted.
    """

    def __init__(self, logger: logging.Logger, again_after_s: float = _AGAIN_AFTER_S) -> None:
        self._logger = logger
        self._again_after_s = again_after_s
        self._lock = threading.Lock()
        self._last_s: dict[str, float] = {}
        self._suppressed: dict[str, int] = {}

    def warn(self, kind: str, detail: str) -> None:
        """Warn of ``kind``; ``detail`` describes this case."""
        now_s = time.monotonic()
        with self._lock:
            if now_s - self._last_s.get(kind, -self._again_after_s) < self._again_after_s:
                self._suppressed[kind] = self._suppressed.get(kind, 0) + 1
                return
            self._last_s[kind] = now_s
            suppressed = self._suppressed.pop(kind, 0)
        more = f" (and {suppressed} more since the last such line)" if suppressed else ""
        self._logger.warning("%s: %s%s", kind, detail, more)
