"""Bytes on their way to a card and back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.gpu.native import WRITE, Commands, Native

if TYPE_CHECKING:
    from carstage_sim.render.gpu.device import Gpu

_BLOCK = 256
"""Copies and sizes are multiples of this many bytes."""


class Readback:
    """Bytes on their way from a card.

    Args:
        gpu: the card.
        buffer: where they arrive.
        size: how many.
    """

    def __init__(self, gpu: Gpu, buffer: Any, size: int) -> None:
        self._gpu, self.buffer, self._size = gpu, buffer, size

    def bytes(self, after: int) -> NDArray[np.uint8]:
        """Wait for the submission that writes them; once."""
        return self._gpu.received(self.buffer, self._size, after)


class Upload:
    """An array that changes in every tick, on its way to a card.

    Args:
        gpu: the card.
        native: its own functions.
        size: bytes that there is room for.

    Attributes:
        buffer: what kernels read.
    """

    def __init__(self, gpu: Gpu, native: Native, size: int) -> None:
        self._gpu, self._native = gpu, native
        self.size = size
        self.buffer = gpu.storage(size)
        self._staging = gpu.filled(size)
        self._after = 0

    def write(self, array: NDArray[Any], commands: Commands) -> None:
        """Have an array, which may change afterwards, copied to the card."""
        data = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
        size = padded(len(data))
        target = self._native.map(self._staging, size, WRITE, self._after, _nothing)
        self._gpu.copy(target[: len(data)], data)
        del target
        self._native.unmap(self._staging)
        commands.copy(self._staging, 0, self.buffer, 0, size)

    def read_by(self, submission: int) -> None:
        """Say with which submission it goes."""
        self._after = submission


def _nothing() -> None:
    """What is mapped for writing is unmapped by the writer."""


def padded(size: int) -> int:
    """The next multiple of the block size that is not zero."""
    return max(_BLOCK, -(-size // _BLOCK) * _BLOCK)
