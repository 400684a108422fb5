"""Pictures that clients put on objects, and on props, as their textures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LARGEST_PX = 1024
"""Larger pictures are brought to this many pixels along their longer side."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedPicture:
    """A texture whose colours differ, and the box over whose faces it is spread.

    Attributes:
        texels: ``(H, W, 3)`` float32 linear red, green, blue; row 0 is the lowest.
        center: metres, in the world, of a prop in its own frame.
        axes: ``(3, 3)`` float64, its columns the box's axes there.
        extent: half sizes, metres.
    """

    texels: NDArray[np.float32]
    center: tuple[float, float, float]
    axes: NDArray[np.float64]
    extent: tuple[float, float, float]


def reduced(texels: NDArray[np.float32]) -> NDArray[np.float32]:
    """A picture of at most :data:`LARGEST_PX` pixels a side; halved as often as that takes."""
    while max(texels.shape[:2]) > LARGEST_PX:
        texels = halved(texels)
    return texels


def halved(texels: NDArray[np.float32]) -> NDArray[np.float32]:
    """``(ceil(H / 2), ceil(W / 2), 3)`` means of four texels each; an odd side repeats its last."""
    height, width = texels.shape[:2]
    even = np.pad(texels, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    quarter = np.float32(0.25)
    top = even[0::2, 0::2] + even[0::2, 1::2]
    below = even[1::2, 0::2] + even[1::2, 1::2]
    smaller: NDArray[np.float32] = (top + below) * quarter
    return smaller
