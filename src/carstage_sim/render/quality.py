"""How much work a picture is worth."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray


class Quality(str, Enum):
    """Quality of colour pictures; what other sensors measure does not depend on it.

    ``LOW``: one sample per pixel, sun shadow, the sky's model, edges sampled again, textures and
    crowns smoothed, the town mirrored in water. ``EPIC``: more samples on more edges, the sky felt
    by rays, and the town mirrored in all that is glossy.
    """

    LOW = "low"
    EPIC = "epic"


@dataclass(frozen=True, slots=True)
class Sampling:
    """Which pixels are sampled again, and where.

    Attributes:
        offsets: ``(K, 2)`` float32 places (right, down) of the extra rays from the pixel's centre,
            in pixels.
        strong: difference of 8-bit codes between neighbours from which both are sampled again.
        weak: the same where they show different objects, materials, or sides of one.
        blend: whether pixels that are like all around them take from those instead.
    """

    offsets: NDArray[np.float32]
    strong: int
    weak: int
    blend: bool


SAMPLING: dict[Quality, Sampling] = {
    Quality.LOW: Sampling(
        np.array([[-0.33, -0.24], [0.33, 0.24]], np.float32), strong=26, weak=12, blend=True
    ),
    Quality.EPIC: Sampling(
        np.array(
            [[-0.40, -0.12], [0.12, -0.40], [0.40, 0.14], [-0.14, 0.40], [0.26, -0.26]], np.float32
        ),
        strong=22,
        weak=8,
        blend=False,
    ),
}
