"""Stars of a clear night, at directions that never change.

The sphere of directions is cut into the cells of a cube's six faces. A cell holds one star or none;
place, brightness and colour follow from the cell's number. A star covers a pixel or more, so that
it neither flickers nor falls between rays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from carstage_sim.kernels import device
from carstage_sim.render.detail import hash_unit

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_CELLS: Any = np.float32(40)
"""Along an edge of a face."""
_SHARE: Any = np.float32(0.42)
"""Of the cells that hold a star: some 4,000 on the sphere, as the eye sees them far from towns."""
_MARGIN: Any = np.float32(0.2)
"""Between a star and the edge of its cell, in cells: no star is cut off there."""
_PIXELS: Any = np.float32(1.1)
"""Radius of a star."""
_FAINTEST: Any = np.float32(0.05)
_BRIGHTEST: Any = np.float32(1.6)
"""Share of the brightness of a lamp that the camera shows as white."""
_SEED: Any = 83
_FROM_RISE: Any = np.float32(0.02)
_PER_RISE: Any = np.float32(4)
"""Air and light near the horizon hide stars; from 15 degrees on they are as bright as above."""


@device
def starlight(x, y, z, pixel_angle):  # type: ignore[no-untyped-def]
    """Light of a star in a unit direction: red, green and blue, 1 for a white lamp.

    Args:
        x, y, z: the direction.
        pixel_angle: of a pixel, rad.
    """
    clear = min(max((z - _FROM_RISE) * _PER_RISE, _ZERO), _ONE)
    ax, ay, az = abs(x), abs(y), abs(z)
    face, u, v, most = 0, x, y, az
    if ax >= ay and ax >= az:
        face, u, v, most = (1 if x > 0 else 2), y, z, ax
    elif ay >= az:
        face, u, v, most = (3 if y > 0 else 4), x, z, ay
    per_edge = np.float32(0.5) * _CELLS
    s, t = (u / most + _ONE) * per_edge, (v / most + _ONE) * per_edge
    i, j = int(s), int(t)
    seed = _SEED + 8 * face
    r, g, b = _ZERO, _ZERO, _ZERO
    if clear > 0 and hash_unit(i, j, seed) < _SHARE:
        room = _ONE - _MARGIN - _MARGIN
        away_s = s - np.float32(i) - _MARGIN - room * hash_unit(i, j, seed + 1)
        away_t = t - np.float32(j) - _MARGIN - room * hash_unit(i, j, seed + 2)
        # A face's corners are farther away than its middle: an angle covers more of it there.
        reach = min(pixel_angle * _PIXELS * per_edge / (most * most), _MARGIN)
        far = (away_s * away_s + away_t * away_t) / max(reach * reach, np.float32(1e-9))
        if far < _ONE:
            size = hash_unit(i, j, seed + 3)
            size = size * size
            size = size * size
            bright = (_FAINTEST + (_BRIGHTEST - _FAINTEST) * size * size) * clear
            bright *= (_ONE - far) * (_ONE - far)
            warm = (hash_unit(i, j, seed + 4) - np.float32(0.5)) * np.float32(0.5)
            r, g, b = bright * (_ONE + warm), bright, bright * (_ONE - warm)
    return r, g, b
