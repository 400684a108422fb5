"""Wooded hills beyond the land, so that no plain ends at the sky."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray

from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh

_SIDES = 144
_OFFSETS_M = (-4.0, 60.0, 140.0, 225.0, 320.0)
"""How far beyond the land's edge each ring of places is; the first lies under the land."""
_HEIGHTS_M = (-1.0, 3.0, 13.0, 25.0, 36.0)
_WAVES = (2, 3, 5, 7, 11, 17)
"""Hills around the whole, by waves of these numbers."""


def hills_mesh(
    land: shapely.Polygon,
    height_at: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    rng: np.random.Generator,
) -> TriangleMesh:
    """A ring of hills around a rectangle of land, tagged as vegetation.

    Args:
        land: the rectangle.
        height_at: height (m) of the land at ``(N, 2)`` places.
        rng: draws the hills.
    """
    x0, y0, x1, y1 = land.bounds
    middle, half = np.array([x0 + x1, y0 + y1]) / 2, np.array([x1 - x0, y1 - y0]) / 2
    angle = np.linspace(0.0, 2 * np.pi, _SIDES, endpoint=False)
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    edge = way * (half / np.maximum(np.abs(way), 1e-9)).min(axis=1, keepdims=True)
    foot = height_at(middle + edge * (1.0 - 5.0 / np.hypot(edge[:, :1], edge[:, 1:])))
    rings = []
    for offset, height in zip(_OFFSETS_M, _HEIGHTS_M, strict=True):
        waves = np.zeros(_SIDES)
        for number in _WAVES:
            phase, strength = rng.uniform(0.0, 2 * np.pi), rng.uniform(0.3, 1.0)
            waves += np.sin(angle * number + phase) * strength / np.sqrt(number)
        share = 0.72 + 0.42 * waves
        rise = height * np.maximum(share, 0.1) if height > 0.0 else np.full(_SIDES, height)
        rings.append(np.column_stack([middle + edge + way * offset, foot + rise]))
    points = np.concatenate(rings).round(3)
    here = np.arange(_SIDES)
    after = (here + 1) % _SIDES
    quads = [
        np.stack([here, after, after + _SIDES, here + _SIDES], axis=1) + ring * _SIDES
        for ring in range(len(rings) - 1)
    ]
    corners = np.concatenate(quads)
    triangles = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    return build_mesh(
        points, triangles, Material.WOODS, CityObjectLabel.VEGETATION,
        normals=_smooth(points, triangles),
    )  # fmt: skip


def _smooth(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """``(T, 3, 3)`` upward normals that neighbours share."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    flat *= np.sign(flat[:, 2:])
    total = np.zeros_like(points)
    for k in range(3):
        np.add.at(total, triangles[:, k], flat)
    total /= np.sqrt((total * total).sum(axis=1, keepdims=True))
    normals: NDArray[np.float64] = total[triangles]
    return normals
