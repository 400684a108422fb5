"""Which triangle a ray along an axis meets first, without the ray caster."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def first_triangle(
    corners: NDArray[np.float64], eye: Any, direction: float, axis: int = 0
) -> int | None:
    """Number of the triangle, of ``(T, 3, 3)`` corners; None for nothing."""
    others = [k for k in range(3) if k != axis]
    a, b, c = (corners[:, k][:, others] - np.array(eye)[others] for k in range(3))

    def cross(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]

    w = np.stack([cross(b, c), cross(c, a), cross(a, b)], axis=1)
    total = w.sum(axis=1)
    inside = (np.all(w >= -1e-12, axis=1) | np.all(w <= 1e-12, axis=1)) & (np.abs(total) > 1e-9)
    share = w / np.where(np.abs(total) > 1e-9, total, 1.0)[:, None]
    away = ((share * corners[:, :, axis]).sum(axis=1) - eye[axis]) * direction
    away = np.where(inside & (away > 0), away, np.inf)
    return int(away.argmin()) if np.isfinite(away.min()) else None
