"""Which triangles of the plane are near a place: a grid of cells names what reaches into each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_MOST_CELLS = 4_000_000
_EDGE = 1e-6  # of a cell: what ends on a cell's edge belongs to both sides


class CellIndex:
    """A grid over the plane: per cell the triangles that reach into it.

    Args:
        corners: ``(T, 3, 2)``; a segment is a triangle with two equal corners.
        finest_cell_m: side of a cell; cells are larger where the world needs too many of them.
    """

    def __init__(self, corners: FloatArray, finest_cell_m: float) -> None:
        low = corners.min(axis=(0, 1)) if len(corners) else np.zeros(2)
        high = corners.max(axis=(0, 1)) if len(corners) else np.zeros(2)
        self._cell_m = max(finest_cell_m, float(np.sqrt(np.prod(high - low) / _MOST_CELLS)))
        self._low = low
        self._shape: IntArray = np.floor((high - low) / self._cell_m).astype(np.int64) + 1
        cell, owner = self._rasterised((corners - low) / self._cell_m)
        order = np.argsort(cell, kind="stable")
        self._entries: IntArray = owner[order]
        self._start: IntArray = np.concatenate(
            [[0], np.cumsum(np.bincount(cell, minlength=int(self._shape.prod())))]
        ).astype(np.int64)

    def at(self, places: FloatArray) -> tuple[IntArray, IntArray]:
        """Number of entries of each place's cell, and all these entries one after the other."""
        cell = np.floor((places - self._low) / self._cell_m).astype(np.int64)
        inside = ((cell >= 0) & (cell < self._shape)).all(axis=1)
        number = np.where(inside, cell[:, 0] * self._shape[1] + cell[:, 1], 0)
        first = self._start[number]
        count = np.where(inside, self._start[number + 1] - first, 0)
        return count, self._entries[ranges(first, count)]

    def within(self, low: FloatArray, high: FloatArray) -> tuple[IntArray, IntArray]:
        """Pairs of rectangles and what may reach into them.

        A triangle that reaches into several cells of a rectangle comes several times.

        Args:
            low, high: ``(M, 2)`` corners of rectangles.

        Returns:
            Rows of the rectangles, ascending, and of the triangles.
        """
        first = np.floor((low - self._low) / self._cell_m).astype(np.int64)
        last = np.floor((high - self._low) / self._cell_m).astype(np.int64)
        first, last = np.maximum(first, 0), np.minimum(last, self._shape - 1)
        span = np.maximum(last - first + 1, 0)
        cells = span.prod(axis=1)
        owner = np.repeat(np.arange(len(low)), cells)
        step = ranges(np.zeros(len(low), np.int64), cells)
        x = first[owner, 0] + step // np.maximum(span[owner, 1], 1)
        y = first[owner, 1] + step % np.maximum(span[owner, 1], 1)
        number = x * self._shape[1] + y
        start = self._start[number]
        count = self._start[number + 1] - start
        return np.repeat(owner, count), self._entries[ranges(start, count)]

    def _rasterised(self, corners: FloatArray) -> tuple[IntArray, IntArray]:
        """Cell numbers and the triangles that reach into them; corners in units of cells.

        Triangle by triangle one strip of cells after the other: a box around a long slanting
        triangle would name many cells that it never touches.
        """
        first = np.floor(corners[..., 0].min(axis=1)).astype(np.int64)
        last = np.floor(corners[..., 0].max(axis=1)).astype(np.int64)
        strips = last - first + 1
        owner = np.repeat(np.arange(len(corners)), strips)
        strip = ranges(first, strips)
        low, high = np.full(len(owner), np.inf), np.full(len(owner), -np.inf)
        for one, other in ((0, 1), (1, 2), (2, 0)):
            a, b = corners[owner, one], corners[owner, other]
            swapped = (a[:, 0] > b[:, 0])[:, None]
            a, b = np.where(swapped, b, a), np.where(swapped, a, b)
            enters = np.maximum(a[:, 0], strip)
            leaves = np.minimum(b[:, 0], strip + 1.0)
            run = b[:, 0] - a[:, 0]
            slope = np.where(run > 0.0, (b[:, 1] - a[:, 1]) / np.where(run > 0.0, run, 1.0), 0.0)
            y0 = np.where(run > 0.0, a[:, 1] + (enters - a[:, 0]) * slope, a[:, 1])
            y1 = np.where(run > 0.0, a[:, 1] + (leaves - a[:, 0]) * slope, b[:, 1])
            crosses = enters <= leaves
            low = np.where(crosses, np.minimum(low, np.minimum(y0, y1)), low)
            high = np.where(crosses, np.maximum(high, np.maximum(y0, y1)), high)
        bottom = np.clip(np.floor(low - _EDGE), 0, self._shape[1] - 1).astype(np.int64)
        top = np.clip(np.floor(high + _EDGE), 0, self._shape[1] - 1).astype(np.int64)
        cells = top - bottom + 1
        row = np.repeat(strip * self._shape[1], cells)
        return row + ranges(bottom, cells), np.repeat(owner, cells)


def ranges(first: IntArray, count: IntArray) -> IntArray:
    """``first[0], first[0] + 1, … (count[0] of them), first[1], …``."""
    ends = np.cumsum(count)
    offset = np.repeat(first - (ends - count), count)
    return np.asarray(np.arange(int(ends[-1]) if len(ends) else 0) + offset)
