"""Masks and their outlines, for comparisons with the truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import Rectangle


def tight_box(mask: NDArray[np.bool_]) -> Rectangle:
    """Bounds x0, y0, x1, y1 of a mask's pixels, half open."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return float(columns[0]), float(rows[0]), float(columns[-1] + 1), float(rows[-1] + 1)


def inside_polygon(
    mask: NDArray[np.bool_], polygon: Sequence[tuple[float, float]]
) -> NDArray[np.bool_]:
    """Which of a mask's pixels have their centre in a convex, counter-clockwise polygon."""
    rows, columns = np.nonzero(mask)
    u, v = columns + 0.5, rows + 0.5
    inside = np.full(len(u), len(polygon) >= 3)
    for (ax, ay), (bx, by) in zip(polygon, [*polygon[1:], *polygon[:1]], strict=True):
        inside &= (bx - ax) * (v - ay) - (by - ay) * (u - ax) >= 0.0
    return inside
