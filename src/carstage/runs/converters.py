"""A run's converting processes: started early, replaced when they broke, all ended at its end."""

from __future__ import annotations

import os
from typing import Literal

from carstage.conversion import ConversionPool, conversion_pool, load_libraries

_MOST_AUTO = 8
"""This many encode 300 pictures/s."""


class Converters:
    """The pool that converts, and the broken ones before it.

    Args:
        workers: number of processes; ``auto``: one for each usable core, at most eight. Theirs is
            a lower priority, so that they take what the simulator leaves.
        pictures: whether there will be any.
    """

    def __init__(self, workers: int | Literal["auto"], *, pictures: bool) -> None:
        cores = len(os.sched_getaffinity(0))
        self._workers = min(cores, _MOST_AUTO) if workers == "auto" else workers
        self._pictures = pictures
        self._pool: ConversionPool | None = None
        self._retired: list[ConversionPool] = []

    def pool(self) -> ConversionPool:
        """The pool that takes work now; its libraries begin to load with the first call."""
        if self._pool is None:
            self._pool = start_pool(self._workers, self._pictures)
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


def start_pool(workers: int, pictures: bool) -> ConversionPool:
    """Converters whose libraries begin to load at once; there are as many as the work needs."""
    return conversion_pool(workers, preload=(load_libraries, (pictures,)))
