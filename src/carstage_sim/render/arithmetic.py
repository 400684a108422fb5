"""Functions of real numbers by additions, products and roots alone.

A library's ``exp`` or ``atan2`` is another one on each system, and may round differently on each
processor. These are the same everywhere, and cost less. How far each may be off is said; pictures
have 256 codes.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from carstage_sim.kernels import device, inlined

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_HALF: Any = np.float32(0.5)
_QUARTER: Any = np.float32(0.25)
_PART: Any = np.float32(1 / 64)
_MOST: Any = np.float32(60)


@inlined
def exp_down(x):  # type: ignore[no-untyped-def]
    """``exp(-x)`` for ``x >= 0``, to 2e-5."""
    y = min(x, _MOST) * _PART
    p = _ONE + y * (_ONE + y * (_HALF + y * (np.float32(1 / 6) + y * np.float32(1 / 24))))
    # To the 64th power.
    p = p * p
    p = p * p
    p = p * p
    p = p * p
    p = p * p
    p = p * p
    return _ONE / p


@inlined
def exp_of(x):  # type: ignore[no-untyped-def]
    """``exp(x)`` for ``-60 <= x <= 60``, to 5e-5 of itself up to 10."""
    down = exp_down(abs(x))
    return down if x < 0 else _ONE / down


@inlined
def power_of_slant(x):  # type: ignore[no-untyped-def]
    """``x ** 0.7`` for ``0.06 <= x <= 1``, to 2e-4."""
    s = math.sqrt(math.sqrt(x))
    rest = np.float32(0.06713677) + s * (
        np.float32(1.12790178) + s * (np.float32(-0.25858590) + s * np.float32(0.06358701))
    )
    return s * s * rest


@device
def turns(y, x):  # type: ignore[no-untyped-def]
    """``atan2(y, x)`` in turns, -0.5 to 0.5, to 2e-6."""
    ax, ay = abs(x), abs(y)
    a = min(ax, ay) / max(max(ax, ay), np.float32(1e-20))
    q = a * a
    t = a * (
        np.float32(0.9998660)
        + q
        * (
            np.float32(-0.3302995)
            + q * (np.float32(0.1801410) + q * (np.float32(-0.0851330) + q * np.float32(0.0208351)))
        )
    )
    t = t * np.float32(0.5 / math.pi)
    if ay > ax:
        t = _QUARTER - t
    if x < 0:
        t = _HALF - t
    return t if y >= 0 else -t


@device
def elevation(z):  # type: ignore[no-untyped-def]
    """``asin(z)`` in right angles for ``0 <= z <= 1``, to 1e-7."""
    p = np.float32(-0.0012624911)
    p = p * z + np.float32(0.0066700901)
    p = p * z + np.float32(-0.0170881256)
    p = p * z + np.float32(0.0308918810)
    p = p * z + np.float32(-0.0501743046)
    p = p * z + np.float32(0.0889789874)
    p = p * z + np.float32(-0.2145988016)
    p = p * z + np.float32(1.5707963050)
    return max(_ONE - math.sqrt(max(_ONE - z, _ZERO)) * p * np.float32(2 / math.pi), _ZERO)
