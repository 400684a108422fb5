"""``python -m benchmarks.framework.clients.slow_disk PLAN.json``: the collector on a slow disk.

It is the collector as it ships, but each record takes the time that a disk of the plan's
``disk_bytes_per_s`` would need. The writer of streams is replaced in this process alone: the
collector has no setting that only a measurement needs.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from carstage.collector.__main__ import main, parse_options
from carstage.collector.internals import writing
from carstage.rawlog.format import Buffer
from carstage.rawlog.writing import StreamWriter


class SlowDisk:
    """Lets bytes pass at a rate, all threads together.

    Args:
        bytes_per_s: the rate.
    """

    def __init__(self, bytes_per_s: float) -> None:
        self._bytes_per_s = bytes_per_s
        self._lock = threading.Lock()
        self._busy_until_s = 0.0
        self._never = threading.Event()

    def take(self, size_bytes: int) -> None:
        """Return when the disk has taken so many bytes."""
        with self._lock:
            now_s = time.monotonic()
            self._busy_until_s = max(now_s, self._busy_until_s) + size_bytes / self._bytes_per_s
            wait_s = self._busy_until_s - now_s
        self._never.wait(wait_s)


def slow_writer(disk: SlowDisk) -> type[StreamWriter]:
    """A writer of streams that writes to such a disk."""

    class SlowStreamWriter(StreamWriter):
        def append(
            self,
            kind: int,
            tick: int,
            frame: int,
            timestamp_s: float,
            meta: Mapping[str, Any],
            payload: Buffer = b"",
            waits: bool = False,
        ) -> None:
            disk.take(len(payload))
            super().append(kind, tick, frame, timestamp_s, meta, payload, waits)

    return SlowStreamWriter


if __name__ == "__main__":
    plan = json.loads(Path(parse_options(None).plan).read_text("utf-8"))
    vars(writing)["StreamWriter"] = slow_writer(SlowDisk(plan["disk_bytes_per_s"]))
    sys.exit(main())
