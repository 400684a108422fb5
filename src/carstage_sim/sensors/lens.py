"""Lens distortion of cameras, from CARLA's lens attributes.

CARLA distorts in a shader that is part of its binary content, and documents no formula; a picture
is undistorted while ``lens_circle_multiplier`` is 0, which is the default. Here a pixel at ``p``,
in half widths and half heights from the middle and at ``r`` from it in half diagonals, shows what a
pinhole camera would show at

    p * (1 - (k + kcube * r) * multiplier * r^falloff * size)

with the size of each axis: the default ``k`` of -1 gives a barrel distortion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from carstage_sim.sensors.attributes import number, require

Array = NDArray[np.float64]

_ITERATIONS = 30
_LARGEST = 10.0


@dataclass(frozen=True, slots=True)
class Lens:
    """A lens; equal lenses distort equally. The default is a pinhole's.

    Attributes:
        multiplier: strength, 0 for none.
        falloff: power of the distance from the middle with which it grows.
        k, kcube: constant and linear part of the distortion; negative for a barrel.
        x_size, y_size: strength along each axis.
    """

    multiplier: float = 0.0
    falloff: float = 5.0
    k: float = -1.0
    kcube: float = 0.0
    x_size: float = 0.08
    y_size: float = 0.08

    @classmethod
    def of(cls, attributes: Mapping[str, str]) -> Lens:
        """The lens of a camera's attributes; all that distort nothing are the same lens.

        Raises:
            SensorAttributeError: a value is no number or below what has a meaning.
        """
        usual = cls()
        lens = cls(
            multiplier=number(attributes, "lens_circle_multiplier", usual.multiplier),
            falloff=number(attributes, "lens_circle_falloff", usual.falloff),
            k=number(attributes, "lens_k", usual.k),
            kcube=number(attributes, "lens_kcube", usual.kcube),
            x_size=number(attributes, "lens_x_size", usual.x_size),
            y_size=number(attributes, "lens_y_size", usual.y_size),
        )
        require(lens.multiplier >= 0, "lens_circle_multiplier must not be negative")
        require(lens.falloff >= 0, "lens_circle_falloff must not be negative")
        return lens if lens.distorts else usual

    @property
    def distorts(self) -> bool:
        """Whether it is anything else than a pinhole."""
        return bool(self.multiplier and (self.k or self.kcube) and (self.x_size or self.y_size))

    def undistorted(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Where a pinhole camera shows what this one shows at ``x, y``, both -1 to 1."""
        r = np.sqrt((x * x + y * y) / 2.0)
        bend = (self.k + self.kcube * r) * self.multiplier * r**self.falloff
        # Beyond these bounds a lens would turn the picture inside out.
        scale_x = np.clip(1.0 - bend * self.x_size, 0.05, _LARGEST)
        scale_y = np.clip(1.0 - bend * self.y_size, 0.05, _LARGEST)
        return x * scale_x, y * scale_y

    def distorted(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Where this camera shows what a pinhole camera shows at ``x, y``, by iteration."""
        if not self.distorts:
            return x, y
        u, v = x.copy(), y.copy()
        for _ in range(_ITERATIONS):
            at_x, at_y = self.undistorted(u, v)
            u, v = u + 0.5 * (x - at_x), v + 0.5 * (y - at_y)
        return u, v


PINHOLE = Lens()
"""Bends nothing."""


@lru_cache(maxsize=16)
def pixel_places(width: int, height: int, lens: Lens) -> tuple[Array, Array]:
    """Where a pinhole camera shows each pixel's centre: x to the right, y down, -1 to 1, flat."""
    across = np.tile((np.arange(width) + 0.5) * (2.0 / width) - 1.0, height)
    down = np.repeat((np.arange(height) + 0.5) * (2.0 / height) - 1.0, width)
    return lens.undistorted(across, down) if lens.distorts else (across, down)
