"""The collector's events: one JSON object per line on standard output."""

from __future__ import annotations

import json
import os
import threading
import time
from typing import Any, Callable, Dict

from carstage.collector.internals.stopping import StopRequest

TICK_INTERVAL_S = 0.1
WARM_UP_INTERVAL_S = 1.0


class EventStream:
    """Prints events, from any thread; a reader that has gone is a request to end.

    Args:
        fd: where the lines go.
        stop: requested when nobody reads any more.
        wall_clock_s: Unix time for the events' ``time``.
        clock_s: monotonic time, for throttling.
    """

    def __init__(
        self,
        fd: int,
        stop: StopRequest,
        wall_clock_s: Callable[[], float] = time.time,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._fd = fd
        self._stop = stop
        self._wall_clock_s = wall_clock_s
        self._clock_s = clock_s
        self._lock = threading.Lock()
        self._told_s: Dict[str, float] = {}
        self._reader_gone = False

    def emit(self, event: str, **fields: Any) -> None:
        """Print one event; see docs/formats/run-folder.md for names and fields."""
        line = json.dumps(
            dict({"time": self._wall_clock_s(), "event": event}, **fields), ensure_ascii=False
        )
        data = line.encode("utf-8") + b"\n"
        with self._lock:
            if self._reader_gone:
                return
            try:
                while data:
                    data = data[os.write(self._fd, data) :]
            except BrokenPipeError:
                self._reader_gone = True
                self._stop.request("nobody reads its events any more")

    def tick(self, episode_id: str, last: bool, **fields: Any) -> None:
        """Print a ``tick`` event unless one was printed a moment ago; the last one always."""
        if last or self._is_due("tick", TICK_INTERVAL_S):
            self.emit("tick", episode_id=episode_id, **fields)

    def warm_up(self, episode_id: str, **fields: Any) -> None:
        """Print a ``warm_up`` event unless one was printed in the last second."""
        if self._is_due("warm_up", WARM_UP_INTERVAL_S):
            self.emit("warm_up", episode_id=episode_id, **fields)

    def _is_due(self, event: str, interval_s: float) -> bool:
        """Whether an event was not printed within the interval; it is taken as printed now."""
        now_s = self._clock_s()
        if event in self._told_s and now_s - self._told_s[event] < interval_s:
            return False
        self._told_s[event] = now_s
        return True
