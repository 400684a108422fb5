"""A run's converting processes: started early, replaced when they broke, all ended at its end."""

from __future__ import annotations

import os
from functools import partial
from typing import Literal

from carstage.config import Config
from carstage.conversion import ThreadFirst, import_libraries
from carstage.processes import ProcessPool, process_pool

_MOST_AUTO = 8
"""This many encode 300 pictures/s."""


class Converters:
    """The pool that converts, and the broken ones before it.

    Args:
        workers: number of processes; ``auto``: one for each usable core, at most eight. Theirs is
            a lower priority, so that they take what the simulator leaves.
        pictures: whether there will be any.
        light: whether frames are written about as they were recorded. A thread of this process
            does that, and processes are started only where it lags behind.
    """

    def __init__(
        self, workers: int | Literal["auto"], *, pictures: bool, light: bool = False
    ) -> None:
        cores = len(os.sched_getaffinity(0))
        self._workers = min(cores, _MOST_AUTO) if workers == "auto" else workers
        self._pictures = pictures
        self._light = light
        self._pool: ProcessPool | ThreadFirst | None = None
        self._retired: list[ProcessPool | ThreadFirst] = []

    def pool(self) -> ProcessPool | ThreadFirst:
        """The pool that takes work now; its libraries begin to load with the first call."""
        if self._pool is None:
            start = partial(start_pool, self._workers, self._pictures)
            self._pool = ThreadFirst(start) if self._light else start()
        return self._pool

    def retire(self) -> None:
        """Use another pool from the next attempt on; this one broke, and with it its processes."""
        if self._pool is not None:
            self._retired.append(self._pool)
            self._pool = None

    def kill(self) -> None:
        """End all processes in the middle of their work."""
        self.retire()
        for pool in self._retired:
            pool.kill()

    def end(self, *, at_once: bool = False) -> None:
        """End all processes; what is not yet begun is not converted.

        Args:
            at_once: nor is what they are converting.
        """
        if at_once:
            self.kill()
        self.retire()
        for pool in self._retired:
            pool.shutdown(wait=True, cancel_futures=True)


def is_light(config: Config) -> bool:
    """Whether all frames are written about as they were recorded, and labels need no pictures."""
    sensors = [sensor.row for _, sensor in config.sensors_of_all_variants()]
    made = any(row.is_camera or row.recorded for row in sensors)
    return not (made or config.labels.occupancy or config.labels.birds_eye)


def start_pool(workers: int, pictures: bool) -> ProcessPool:
    """Converters whose libraries begin to load at once; there are as many as the work needs."""
    return process_pool(workers, preload=(import_libraries, (pictures,)))
