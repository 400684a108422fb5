"""Loops over a camera's picture as it came, compiled; see ``png`` and ``images``."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.kernels import compiled

_LOW_BITS: Final = np.uint32(0x7F7F7F)
_HIGH_BITS: Final = np.uint32(0x808080)
_ZERO: Final = np.uint32(0)
_EIGHT: Final = np.uint32(8)
_SIXTEEN: Final = np.uint32(16)


@compiled
def filter_up(pixels: NDArray[np.uint32], rows: NDArray[np.uint8]) -> Any:
    """Red, green and blue of each pixel less those of the pixel above, modulo 256.

    Three channels are subtracted in one word: without their highest bits none borrows of the next
    one, and those bits are put right afterwards.

    Args:
        pixels: ``(H, W)``, of bytes blue, green, red, alpha.
        rows: ``(H, 1 + 3 W)``; the first byte of each row stays as it is.
    """
    height, width = pixels.shape
    for row in range(height):
        for column in range(width):
            here = pixels[row, column]
            above = pixels[row - 1, column] if row else _ZERO
            low = (here | _HIGH_BITS) - (above & _LOW_BITS)
            less = low ^ ((here ^ ~above) & _HIGH_BITS)
            rows[row, 1 + 3 * column] = less >> _SIXTEEN
            rows[row, 2 + 3 * column] = less >> _EIGHT
            rows[row, 3 + 3 * column] = less


@compiled
def colours(pixels: NDArray[np.uint32], rows: NDArray[np.uint8]) -> Any:
    """Red, green and blue of each pixel.

    Args:
        pixels: ``(H, W)``, of bytes blue, green, red, alpha.
        rows: ``(H, 3 W)``, to be filled.
    """
    height, width = pixels.shape
    for row in range(height):
        for column in range(width):
            here = pixels[row, column]
            rows[row, 3 * column] = here >> _SIXTEEN
            rows[row, 1 + 3 * column] = here >> _EIGHT
            rows[row, 2 + 3 * column] = here
