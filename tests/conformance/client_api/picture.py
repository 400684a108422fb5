"""Pictures of cameras, with the standard library alone: foreign interpreters have no other."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from statistics import fmean, pstdev


@dataclass(frozen=True)
class Picture:
    """A picture of a camera.

    Attributes:
        bgra: ``H * W * 4`` bytes, row by row.
    """

    bgra: bytes

    @property
    def red(self) -> bytes:
        """One byte per pixel; in semantic pictures the label."""
        return self.bgra[2::4]

    @property
    def blue(self) -> bytes:
        """One byte per pixel."""
        return self.bgra[0::4]

    @property
    def is_black(self) -> bool:
        """Whether no pixel has a colour."""
        return not any(any(self.bgra[channel::4]) for channel in range(3))

    def mean(self) -> float:
        """Mean of all channels, 0 to 255."""
        return fmean(sum(self.bgra[channel::4]) for channel in range(3)) * 4 / len(self.bgra)

    def contrast(self) -> float:
        """Standard deviation of the green channel."""
        return pstdev(self.bgra[1::4])

    def share(self, label: int) -> float:
        """Share of the pixels of a label, in a semantic picture."""
        return self.red.count(label) / len(self.red)


def changed(before: Picture, after: Picture, threshold: int = 24) -> float:
    """Share of the pixels that differ by more than ``threshold`` in some channel."""
    channels = (zip(before.bgra[n::4], after.bgra[n::4]) for n in range(3))
    apart = [[abs(a - b) > threshold for a, b in channel] for channel in channels]
    return sum(map(any, zip(*apart))) / len(apart[0])


def floats(data: bytes) -> list[float]:
    """Single-precision numbers, as a flow picture holds them."""
    return [number for (number,) in struct.iter_unpack("<f", data)]
