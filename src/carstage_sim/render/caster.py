"""Runs ray kernels over batches, split into bands for a few threads."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.cast import Scene, new_scratch
from carstage_sim.render.crew import Crew, Shared, for_workers
from carstage_sim.render.packet_simd import PACKET
from carstage_sim.render.packets import new_packet_scratch
from carstage_sim.render.rolling import Rows
from carstage_sim.render.shared_kernels import share_cast_packets, share_cast_rays

BAND = 8192
"""Pixels of a band: small enough to balance, large enough to hide the call."""
_RAYS, _PACKETS = 256, 16
"""Rays, and groups of them, that a kernel takes at a time."""
_FEWEST_PACKETS = 4
"""As :data:`_PACKETS`, of work that gives way (others wait for a piece of it), or of little work
for many threads."""
_MANY_CORES = 8
_PARTS_PER_THREAD = 8
"""Parts of a pass, if there are enough: the last ones are done while other threads wait."""
SQUARE = 8
"""Pixels along each side of a square whose rays run side by side."""
_PIECES = 16
"""Of a pass that gives way to others in between."""


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


@dataclass(frozen=True, slots=True, eq=False)
class Packets:
    """Rays that run side by side, in groups.

    Attributes:
        order: ``(N,)`` int32 the rays' numbers, group after group.
        starts: ``(P + 1,)`` int32 where in ``order`` each group begins; at most 64 apart.
    """

    order: NDArray[np.int32]
    starts: NDArray[np.int32]


class Slopes(NamedTuple):
    """Slopes of a camera's rays, whose component along the optical axis is 1.

    Attributes:
        rotation: ``(3, 3)`` float64 world_from_camera.
        right, up: ``(N,)`` float64 of each ray.
    """

    rotation: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]


AIMED = Slopes(np.eye(3), np.empty(0), np.empty(0))
"""Of rays that have directions."""


@lru_cache(maxsize=16)
def picture_packets(width: int, height: int) -> Packets:
    """The rays of a picture's pixels, row by row, in squares of 8 by 8."""
    rows, columns = -(-height // SQUARE), -(-width // SQUARE)
    whole = np.full((rows * SQUARE, columns * SQUARE), -1, np.int32)
    whole[:height, :width] = np.arange(width * height, dtype=np.int32).reshape(height, width)
    squares = (
        whole.reshape(rows, SQUARE, columns, SQUARE).transpose(0, 2, 1, 3).reshape(-1, SQUARE**2)
    )
    within = squares >= 0
    starts = np.zeros(len(squares) + 1, np.int32)
    np.cumsum(np.count_nonzero(within, axis=1), out=starts[1:])
    return Packets(squares[within], starts)


def by_rows(packets: Packets, row_of: NDArray[np.integer]) -> Iterator[tuple[int, Packets]]:
    """Rays of packets, anew in packets of one row of the picture each.

    Args:
        packets: which rays.
        row_of: ``(N,)`` row of each ray.

    Yields:
        A row, and its rays; no row twice.
    """
    rows = row_of[packets.order]
    sorted_ = np.argsort(rows, kind="stable")
    order, rows = packets.order[sorted_], rows[sorted_]
    begins = np.flatnonzero(np.diff(rows, prepend=-1))
    for first, last in zip(begins, [*begins[1:], len(rows)], strict=True):
        starts = np.append(np.arange(0, last - first, PACKET), last - first)
        yield int(rows[first]), Packets(order[first:last], starts.astype(np.int32))


def usual_threads() -> int:
    """One for each CPU that this process may use; of many, one is left to Python and to clients.

    Clients and Python's own threads wait for each other between pictures. Where each CPU casts
    rays, they also wait for a CPU: a tick of the demonstration took a tenth longer with 16 threads
    on 16 cores than with 15.
    """
    cores = len(os.sched_getaffinity(0))
    return cores - 1 if cores >= _MANY_CORES else cores


class RayCaster:
    """Casts rays with a fixed number of threads; results do not depend on that number.

    Several threads may call it at once, which then share those that compute.

    Args:
        threads: threads that compute; default: :func:`usual_threads`.
    """

    def __init__(self, threads: int | None = None) -> None:
        if threads is not None and threads < 1:
            raise ValueError(f"threads must be at least 1, not {threads}")
        self.threads = threads or usual_threads()
        self.ray_count = 0
        """Rays cast so far; those that shading sends to the sun and the sky are not counted."""
        self._lock = threading.Lock()
        self._between: Callable[[], None] | None = None
        self.crew = Crew(self.threads, "rays")
        """Does what :meth:`in_parts` and :meth:`in_packets` hand it."""
        self._scratch = for_workers(self.crew, new_scratch())
        self._packet_scratch = for_workers(self.crew, new_packet_scratch())

    def close(self) -> None:
        """End the threads."""
        self.crew.close()

    @contextmanager
    def in_pieces(self, between: Callable[[], None] | None) -> Iterator[None]:
        """In the block, call ``between`` after each small piece of work; None asks for no pieces.

        It may use this caster itself, in a block of its own.
        """
        before, self._between = self._between, between
        try:
            yield
        finally:
            self._between = before

    def ranked(self, rank: int) -> AbstractContextManager[None]:
        """In the block, rays of the calling thread come after those of lower ranks; 0 elsewhere."""
        return self.crew.ranked(rank)

    def _count(self, rays: int) -> None:
        with self._lock:
            self.ray_count += rays

    def in_parts(self, shared: Shared, data: tuple[Any, ...], count: int, size: int = BAND) -> None:
        """Have the crew do ``range(count)``, in parts of a size; returns when all is done.

        Args:
            shared: the kernel.
            data: for it.
            count, size: of all, and of a part.
        """
        with self.crew.job(0, count, size) as (job, work):
            shared(data, self.crew.board, job, work)

    def in_packets(self, shared: Shared, data: tuple[Any, ...], packets: Packets) -> None:
        """Have the crew do groups of rays.

        Args:
            shared: the kernel, whose items are the groups.
            data: for it.
            packets: the groups.
        """
        count = len(packets.starts) - 1
        even = count // (self.threads * _PARTS_PER_THREAD) if self._between is None else 0
        self._share(shared, data, count, max(min(even, _PACKETS), _FEWEST_PACKETS))

    def _share(self, shared: Shared, data: tuple[Any, ...], count: int, size: int) -> None:
        between = self._between
        piece = count if between is None else max(-(-count // _PIECES), size * self.threads)
        for first in range(0, count, piece or 1):
            with self.crew.job(first, min(first + piece, count), size) as (job, work):
                shared(data, self.crew.board, job, work)
            if between is not None:
                between()

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
        self._count(count)
        hits = unwritten_hits(origin, directions)
        origins = hits.origin.reshape(-1, 3)

        data = (
            self._scratch, scene, origins, hits.directions, np.float32(low), np.float32(high),
            skip_row, hits.t, hits.row, hits.triangle, hits.weights,
        )  # fmt: skip
        self._share(share_cast_rays, data, count, _RAYS)
        return hits

    def cast_together(
        self,
        scene: Scene,
        origin: NDArray[np.floating],
        directions: NDArray[np.float32],
        packets: Packets,
        *,
        low: float,
        high: float,
        skip_row: int = -1,
        slopes: Slopes = AIMED,
    ) -> Hits:
        """As :meth:`cast`, with the same result, faster for rays that run side by side.

        Args:
            scene, directions, low, high, skip_row: as for :meth:`cast`.
            origin: ``(3,)`` world metres.
            packets: which rays do.
            slopes: give, and write, the directions; without any these are known.
        """
        hits = unwritten_hits(origin, directions)
        self._meet(scene, hits.origin, packets, (low, high, skip_row), hits, slopes)
        return hits

    def cast_rows(
        self,
        rows: Rows,
        row_of: NDArray[np.integer],
        hits: Hits,
        packets: Packets,
        *,
        low: float,
        high: float,
        skip_row: int = -1,
    ) -> Hits:
        """As :meth:`cast_together`, of rays from where the camera is in their rows.

        Args:
            rows: of the picture.
            row_of: ``(N,)`` row of each ray.
            hits: the rays; receives what they meet.
            packets, low, high, skip_row: as for :meth:`cast_together`.

        Returns:
            ``hits``.
        """
        for row, some in by_rows(packets, row_of):
            within = (low, high, skip_row)
            self._meet(rows.scene(row), rows.origins[row], some, within, hits)
        return hits

    def _meet(
        self,
        scene: Scene,
        origin: NDArray[np.float32],
        packets: Packets,
        within: tuple[float, float, int],
        hits: Hits,
        slopes: Slopes = AIMED,
    ) -> None:
        """Write what rays from a place meet; ``within``: low, high and skip_row of a cast."""
        low, high, skip_row = within
        self._count(len(packets.order))
        data = (
            self._packet_scratch, scene, origin, hits.directions, packets.order,
            packets.starts, np.float32(low), np.float32(high), skip_row,
            hits.t, hits.row, hits.triangle, hits.weights, *slopes,
        )  # fmt: skip
        self.in_packets(share_cast_packets, data, packets)


def unwritten_hits(origin: NDArray[np.floating], directions: NDArray[np.float32]) -> Hits:
    """Rays whose hits are to be written."""
    count = len(directions)
    return Hits(
        np.ascontiguousarray(origin, np.float32),
        np.ascontiguousarray(directions, np.float32),
        np.empty(count, np.float32),
        np.empty(count, np.int32),
        np.empty(count, np.int32),
        np.empty((count, 2), np.float32),
    )
