"""Which triangles of the plane are near a place: a grid of cells names what reaches into each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_MOST_CELLS = 4_000_000
_EDGE = 1e-6  # of a cell: what ends on a cell's edge belongs to both sides


class CellGrid(NamedTuple):
    """The cells as kernels walk them.

    Cell ``(i, j)`` has number ``k = i * shape[1] + j``; what reaches into it is
    ``entries[start[k] : start[k + 1]]``, ascending.

    Attributes:
        low: ``(2,)`` least corner, metres.
        cell_m: side of a cell.
        shape: number of cells along x and y.
        start: ``(cells + 1,)`` int64.
        entries: rows of triangles.
    """

    low: FloatArray
    cell_m: float
    shape: IntArray
    start: IntArray
    entries: IntArray


def cell_grid(corners: FloatArray, finest_cell_m: float) -> CellGrid:
    """Sorts triangles of the plane into cells.

    Args:
        corners: ``(T, 3, 2)``; a segment is a triangle with two equal corners, a point one with
            three.
        finest_cell_m: side of a cell; cells are larger where the world needs too many of them.
    """
    low = corners.min(axis=(0, 1)) if len(corners) else np.zeros(2)
    high = corners.max(axis=(0, 1)) if len(corners) else np.zeros(2)
    cell_m = max(finest_cell_m, float(np.sqrt(np.prod(high - low) / _MOST_CELLS)))
    shape: IntArray = np.floor((high - low) / cell_m).astype(np.int64) + 1
    cell, owner = _rasterised((corners - low) / cell_m, shape)
    counts = np.bincount(cell, minlength=int(shape.prod()))
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return CellGrid(low, cell_m, shape, start, owner[np.argsort(cell, kind="stable")])


def _rasterised(corners: FloatArray, shape: IntArray) -> tuple[IntArray, IntArray]:
    """Cell numbers and the triangles that reach into them; corners in units of cells.

    Triangle by triangle one strip of cells after the other: a box around a long slanting
    triangle would name many cells that it never touches.
    """
    first = np.floor(corners[..., 0].min(axis=1)).astype(np.int64)
    last = np.floor(corners[..., 0].max(axis=1)).astype(np.int64)
    strips = last - first + 1
    owner = np.repeat(np.arange(len(corners)), strips)
    strip = _ranges(first, strips)
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
    bottom = np.clip(np.floor(low - _EDGE), 0, shape[1] - 1).astype(np.int64)
    top = np.clip(np.floor(high + _EDGE), 0, shape[1] - 1).astype(np.int64)
    cells = top - bottom + 1
    row = np.repeat(strip * shape[1], cells)
    return row + _ranges(bottom, cells), np.repeat(owner, cells)


def _ranges(first: IntArray, count: IntArray) -> IntArray:
    """``first[0], first[0] + 1, … (count[0] of them), first[1], …``."""
    ends = np.cumsum(count)
    offset = np.repeat(first - (ends - count), count)
    return np.asarray(np.arange(int(ends[-1]) if len(ends) else 0) + offset)
