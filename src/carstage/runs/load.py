"""What a run's own processes take of this machine, every few seconds."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import psutil

from carstage.runs.events import Load

LOAD_EVERY_S = 2.0
"""Pause between two samples: one costs some milliseconds, most of it to find the processes."""

_Process = tuple[int, float]
"""A process: its number and when it began, as numbers come again."""


class LoadMeter:
    """Samples this process and all that descend from it: server, collector, converters.

    What a process took between the last sample and its end is not seen. Memory that processes share
    counts for each of them. A server that we did not start is not among them.

    Args:
        place: a folder on the disk that is written to.
        pid: the process; None: this one.
    """

    def __init__(
        self,
        place: Path,
        pid: int | None = None,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._place = place
        self._pid = os.getpid() if pid is None else pid
        self._clock_s = clock_s
        self._looked_s = clock_s()
        self._cpu_s: dict[_Process, float] = {}
        self._written: dict[_Process, int] = {}
        self.sample()

    def sample(self) -> Load:
        """The load since the sample before."""
        now_s = self._clock_s()
        passed_s = max(now_s - self._looked_s, 1e-3)
        self._looked_s = now_s
        cpu_s, written, memory_bytes = {}, {}, 0
        for process in self._family():
            try:
                with process.oneshot():
                    key = (process.pid, process.create_time())
                    times = process.cpu_times()
                    resident = process.memory_info().rss
            except psutil.Error:
                continue  # it has ended
            cpu_s[key] = times.user + times.system
            memory_bytes += resident
            try:
                written[key] = process.io_counters().write_bytes
            except (psutil.Error, AttributeError, OSError):
                continue  # systems without such counters, processes of other users
        took_s = sum(cpu - self._cpu_s.get(key, 0.0) for key, cpu in cpu_s.items())
        wrote = sum(count - self._written.get(key, 0) for key, count in written.items())
        self._cpu_s, self._written = cpu_s, written
        return Load(
            cpu_cores=round(max(0.0, took_s) / passed_s, 3),
            memory_bytes=memory_bytes,
            written_bytes_s=round(max(0, wrote) / passed_s) if written else None,
            disk_free_bytes=shutil.disk_usage(self._place).free,
        )

    def _family(self) -> list[psutil.Process]:
        try:
            root = psutil.Process(self._pid)
            return [root, *root.children(recursive=True)]
        except psutil.Error:
            return []
