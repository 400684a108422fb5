"""Runs ray kernels over batches, split into bands for a few threads."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.cast import Scene, cast_rays, new_scratch

_BAND = 4096
"""Rays per piece of work: small enough to balance, large enough to hide the call."""


@dataclass(frozen=True, slots=True)
class Hits:
    """What N rays met.

    Attributes:
        origin: ``(3,)`` float32 world metres, or ``(N, 3)`` where each ray has its own.
        directions: ``(N, 3)`` float32 world directions, not normalised.
        t: ``(N,)`` float32 parameter in units of the direction's length.
        row: ``(N,)`` int32 instance row, ``cast.STATIC`` or ``cast.NOTHING``.
        triangle: ``(N,)`` int32 triangle number in its geometry, -1 for nothing.
        weights: ``(N, 2)`` float32 barycentric weights of the first and second corner.
    """

    origin: NDArray[np.float32]
    directions: NDArray[np.float32]
    t: NDArray[np.float32]
    row: NDArray[np.int32]
    triangle: NDArray[np.int32]
    weights: NDArray[np.float32]


class RayCaster:
    """Casts rays with a fixed number of threads; results do not depend on that number.

    Args:
        threads: threads that compute; default: the CPUs that this process may use.
    """

    def __init__(self, threads: int | None = None) -> None:
        if threads is not None and threads < 1:
            raise ValueError(f"threads must be at least 1, not {threads}")
        self.threads = threads or len(os.sched_getaffinity(0))
        self.ray_count = 0
        """Rays cast so far; those that shading sends to the sun and the sky are not counted."""
        self._pool = (
            ThreadPoolExecutor(self.threads, thread_name_prefix="rays")
            if self.threads > 1
            else None
        )

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()

    def in_bands(self, count: int, work: Callable[[int, int], None]) -> None:
        """Call ``work(first, last)`` on bands that cover ``range(count)``; returns when all ran."""
        bands = [(start, min(start + _BAND, count)) for start in range(0, count, _BAND)]
        if self._pool is None or len(bands) < 2:
            if count:
                work(0, count)
            return
        for _ in self._pool.map(lambda band: work(*band), bands):
            pass

    def cast(
        self,
        scene: Scene,
        origin: NDArray[np.floating],
        directions: NDArray[np.float32],
        *,
        low: float,
        high: float,
        skip_row: int = -1,
    ) -> Hits:
        """Nearest hits of rays.

        Args:
            scene: what can be met.
            origin: ``(3,)`` world metres, or ``(N, 3)`` for each ray its own.
            directions: ``(N, 3)`` float32 world directions.
            low: smallest ray parameter that counts.
            high: largest ray parameter that counts.
            skip_row: instance row that rays pass through, -1 for none.
        """
        count = len(directions)
        self.ray_count += count
        start = np.ascontiguousarray(origin, np.float32)
        origins = start.reshape(-1, 3)
        hits = Hits(
            start,
            np.ascontiguousarray(directions, np.float32),
            np.empty(count, np.float32),
            np.empty(count, np.int32),
            np.empty(count, np.int32),
            np.empty((count, 2), np.float32),
        )

        def work(first: int, last: int) -> None:
            cast_rays(
                scene, new_scratch(), origins, hits.directions, np.float32(low), np.float32(high),
                skip_row, first, last, hits.t, hits.row, hits.triangle, hits.weights,
            )  # fmt: skip

        self.in_bands(count, work)
        return hits
