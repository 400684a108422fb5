"""Cards of leaves: triangles of which only the leaves on them are there.

A triangle of a leaf material is divided into cells along its two sides, and each cell may hold one
leaf. Where a ray meets a card between the leaves, it goes on. Every ray asks the same question, so
cameras, LiDAR and shadows see the same leaves. Which cell holds what follows from the numbers of
the triangle and the cell; nothing is stored.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from carstage_sim.kernels import device
from carstage_sim.render.detail import hash_unit

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_HALF: Any = np.float32(0.5)
BARE: Any = np.float32(0.08)
"""Share of the cells that hold no leaf."""
LONG: Any = np.float32(0.48)
WIDE: Any = np.float32(0.34)
"""Half length and half width of the smallest leaf, in cells."""
GROWTH: Any = np.float32(0.36)
"""By how much the largest leaf is longer than the smallest."""
ASIDE: Any = np.float32(0.17)
"""How far a leaf may be from the middle of its cell."""
SEED = 101
_LEAF_M: Any = np.float32(0.12)
"""About a leaf's length: where pixels are larger, all leaves have one colour."""


@device
def leaf_at(cells, number, u, v):  # type: ignore[no-untyped-def]
    """The leaf of a card at a place.

    Args:
        cells: as :func:`carstage_sim.render.materials.cells_of_materials` packs them, not 0.
        number: the triangle.
        u, v: weights of its first and second corner.

    Returns:
        ``(cell, along, across)``: a number of the leaf's cell, negative where there is a gap, and
        the place on the leaf, each from -1 to 1.
    """
    # trace.wgsl has the same for cards, and leaf_lanes for eight rays at once.
    rows, columns = np.float32(cells & 15), np.float32(cells >> 4)
    x, y = u * rows, v * columns
    fx, fy = max(np.floor(x), _ZERO), max(np.floor(y), _ZERO)
    # Cells that the third side cuts would show where it runs.
    if (fx + _ONE) * columns + (fy + _ONE) * rows > rows * columns + np.float32(0.01):
        return -1, _ZERO, _ZERO
    cell = int(fx) + 16 * int(fy)
    chance = hash_unit(cell, number, SEED)
    if chance < BARE:
        return -1, _ZERO, _ZERO
    turn = hash_unit(cell, number, SEED + 1) * np.float32(2) - _ONE
    scale = _ONE / (_ONE + turn * turn)
    cosine, sine = (_ONE - turn * turn) * scale, (turn + turn) * scale
    x = x - fx - _HALF - ASIDE * turn
    y = y - fy - _HALF - ASIDE * (chance + chance - _ONE)
    size = _ONE / (_ONE + GROWTH * chance)
    along = (cosine * x + sine * y) * size * (_ONE / LONG)
    across = (cosine * y - sine * x) * size * (_ONE / WIDE)
    if abs(across) > _ONE - along * along:
        return -1, _ZERO, _ZERO
    return cell, along, across


@device
def is_gap(cells, number, u, v):  # type: ignore[no-untyped-def]
    """Whether a ray passes between the leaves of a card; see :func:`leaf_at`."""
    return leaf_at(cells, number, u, v)[0] < 0


@device
def leaf_colour(cells, owner, number, u, v, pixel):  # type: ignore[no-untyped-def]
    """Colour factors (red, green, blue) of the leaf at a place of a card.

    Args:
        cells, number, u, v: as for :func:`leaf_at`.
        owner: the tree, which has a hue of its own.
        pixel: a pixel's side on the leaf, metres.
    """
    tree = hash_unit(owner, 3, 5)
    spray = hash_unit(number, 7, 9)
    cell, along, across = leaf_at(cells, number, u, v)
    near = min(max((_LEAF_M - pixel) * (_ONE / _LEAF_M), _ZERO), _ONE)
    leaf = (hash_unit(cell, number, SEED + 2) - _HALF) * near
    value = np.float32(0.86) + np.float32(0.28) * spray + np.float32(0.5) * leaf
    value += np.float32(0.24) * (tree - _HALF)
    # A leaf is folded a little along its middle: one half is turned to the light.
    value *= _ONE + near * (
        np.float32(0.13) * (_ONE if across > 0 else -_ONE) - np.float32(0.08) * along
    )
    warm = np.float32(0.36) * (tree - _HALF) + np.float32(0.34) * (spray - _HALF)
    warm += np.float32(0.3) * leaf
    return value * (_ONE + warm), value, value * (_ONE - np.float32(0.5) * warm)
