"""Light of street lamps that comes by way of the street and its houses, or from farther lamps.

It changes slowly from place to place, so a grid over the town holds it, made anew when a lamp is
switched. Without it, what no lamp is near to or turned to would have the sky's light only: black
walls beside bright pavements.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device

Array = NDArray[np.float64]

NEAR_M = 26.0
"""Lamps shine so far one by one; their light ends softly there, and the grid has the rest."""
LAMP_INTENSITY = 40.0
"""Irradiance a metre below a lamp of power 1; it falls off with the cosine of the slant."""
STEP_M = 8.0
"""Distance of the grid's nodes."""
_BESIDE = 8
"""Nodes on each side of a lamp that its light reaches."""
_REACH_M = (_BESIDE - 1) * STEP_M
_THROWN_BACK = 2.4
_WIDE_M2 = 144.0
"""Irradiance of an upright wall is the first over the second and the square of its way to a lamp.

In a street with a lamp for each 16 m it is an eighth of what the lamps give the ground. Ground and
houses throw back a fifth, several times, and a wall sees them in a half of its view. What a lamp
lights is about 12 m wide.
"""
_DROP_M2 = 36.0
"""Square of a usual height of a lamp over the places that it lights."""
_NUMBERS = 8
_HEIGHT, _SIDES = 3, 4
"""Numbers of a cell: red, green and blue, height of the lamps, and four sides."""
NOTHING_THROWN = np.zeros((1, 1, 4 * _NUMBERS), np.float32)
"""The grid of a town whose lamps are off."""
_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_FLATTER: Any = np.float32(0.7)
"""How much more a surface gets that faces the ground, and how much less one that faces the sky."""
_LAMP_M: Any = np.float32(8.0)
_FADE_M2: Any = np.float32(256.0)
"""A usual lamp's height, and the square of that over the street which a half comes up to."""
_PER_STEP: Any = np.float32(1 / STEP_M)


class ThrownLight:
    """What each street lamp of a town adds to the grid.

    Args:
        places: ``(L, 3)`` world metres of the lamps.

    Attributes:
        corner: ``(2,)`` float32 world x, y of the first node.
    """

    def __init__(self, places: Array) -> None:
        count = len(places)
        low = places[:, :2].min(axis=0) if count else np.zeros(2)
        high = places[:, :2].max(axis=0) if count else np.zeros(2)
        self.corner = (low - _BESIDE * STEP_M).astype(np.float32)
        self._size = np.ceil((high - self.corner) / STEP_M).astype(int) + _BESIDE + 1
        first = np.floor((places[:, :2] - self.corner) / STEP_M).astype(int) - _BESIDE + 1
        window = np.arange(2 * _BESIDE)
        i = (first[:, :1] + window)[:, :, None]
        j = (first[:, 1:] + window)[:, None, :]
        x = places[:, 0, None, None] - (self.corner[0] + i * STEP_M)
        y = places[:, 1, None, None] - (self.corner[1] + j * STEP_M)
        square = x**2 + y**2
        end = np.maximum(1.0 - square / _REACH_M**2, 0.0) ** 2
        self._nodes = (i * self._size[1] + j).reshape(-1)
        self._back = _THROWN_BACK / (square + _WIDE_M2) * end
        # For each metre that a place is lower than the lamp, on a wall that faces +x, -x, +y, -y.
        beyond = 1.0 - np.maximum(1.0 - square / NEAR_M**2, 0.0) ** 2
        far = LAMP_INTENSITY * beyond * end / (square + _DROP_M2) ** 2
        self._sides = [far * np.maximum(way, 0.0) for way in (x, -x, y, -y)]
        weight = np.maximum(self._sum(self._back, np.ones(count)), 1e-12)
        self._height = self._sum(self._back, places[:, 2]) / weight

    def grid(self, power: NDArray[np.float32]) -> NDArray[np.float32]:
        """``(X, Y, 32)`` float32 of the cells between nodes.

        Eight numbers at the first corner, what they change by along x, y, and both together. They
        are red, green and blue irradiance that is thrown back onto an upright wall; mean height (m)
        of the lamps near; light of farther lamps on walls that face +x, -x, +y and -y, as a share
        of what is thrown back, for each metre below the lamps.

        Args:
            power: ``(L, 3)`` linear RGB of each lamp's light.
        """
        back = [self._sum(self._back, power[:, k].astype(np.float64)) for k in range(3)]
        mean = power.mean(axis=1).astype(np.float64)
        whole = np.maximum(np.mean(back, axis=0), 1e-12)
        sides = [self._sum(side, mean) / whole for side in self._sides]
        node = np.stack([*back, self._height, *sides], axis=-1)
        low, x, y = node[:-1, :-1], node[1:, :-1], node[:-1, 1:]
        both = node[1:, 1:] - x - y + low
        return np.concatenate([low, x - low, y - low, both], axis=-1).astype(np.float32)

    def _sum(self, shares: Array, weight: Array) -> Array:
        """``(X, Y)`` sum of the lamps' ``(L, N, N)`` shares with a weight for each lamp."""
        weighted = (shares * weight[:, None, None]).reshape(-1)
        total = np.bincount(self._nodes, weighted, int(self._size.prod()))
        return total.astype(np.float64).reshape(self._size)


@device
def _within(grid, i, j, k, a, b):  # type: ignore[no-untyped-def]
    """A number within a cell of the grid."""
    at = grid[i, j, k] + grid[i, j, k + _NUMBERS] * a + grid[i, j, k + 2 * _NUMBERS] * b
    return at + grid[i, j, k + 3 * _NUMBERS] * (a * b)


@device
def thrown_light(lamps, x, y, z, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Irradiance (red, green, blue) from the street, its houses and farther lamps, unshadowed.

    Args:
        lamps: a :class:`carstage_sim.render.lamps.Lamps`.
        x, y, z: the place, world metres.
        nx, ny, nz: the surface's normal.
    """
    grid = lamps.thrown
    a = (x - lamps.thrown_corner[0]) * _PER_STEP
    b = (y - lamps.thrown_corner[1]) * _PER_STEP
    if a < 0 or b < 0 or a >= np.float32(grid.shape[0]) or b >= np.float32(grid.shape[1]):
        return _ZERO, _ZERO, _ZERO
    i, j = int(a), int(b)
    a, b = a - np.float32(i), b - np.float32(j)
    below = _within(grid, i, j, _HEIGHT, a, b) - z
    above = max(_LAMP_M - below, _ZERO)
    share = (_ONE - _FLATTER * nz) * _FADE_M2 / (_FADE_M2 + above * above)
    if below > 0:
        side = _within(grid, i, j, _SIDES if nx >= 0 else _SIDES + 1, a, b) * nx * nx
        side += _within(grid, i, j, _SIDES + 2 if ny >= 0 else _SIDES + 3, a, b) * ny * ny
        share += below * side
    return (
        _within(grid, i, j, 0, a, b) * share,
        _within(grid, i, j, 1, a, b) * share,
        _within(grid, i, j, 2, a, b) * share,
    )
