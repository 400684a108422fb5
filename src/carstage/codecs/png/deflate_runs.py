"""Deflate for pictures with noise: Huffman codes and runs of one byte, nothing else.

A camera's pixels less those above hardly repeat: the search for repetitions costs most of the time
of a deflate encoder and finds next to nothing. What is left is that small differences are frequent
(Huffman codes, made anew for each block) and that flat regions are runs of zeros (matches of
distance 1, of whole words). The stream is that of RFC 1950 and RFC 1951; equal bytes give equal
streams.
"""

from __future__ import annotations

from typing import Final

import deflate
import numpy as np
from numpy.typing import NDArray

_ZLIB_HEADER: Final = b"\x78\x01"
_HEAD_BYTES: Final = 256
"""More than head and end of a block take."""


class ZlibOfRuns:
    """Makes zlib streams, in a buffer that it keeps; not for several threads at once."""

    def __init__(self) -> None:
        self._out: NDArray[np.uint8] = np.empty(0, np.uint8)

    def __call__(self, data: NDArray[np.uint8]) -> tuple[bytes | memoryview, ...]:
        """The parts of a stream; they are valid until the next call.

        Args:
            data: contiguous, not empty, any shape.
        """
        # Numba takes half a second to import: only processes that encode pictures shall pay.
        from carstage.codecs.png.deflate_kernel import BLOCK_WORDS, RUNS, WORD_BYTES, encode

        flat = data.reshape(-1)
        whole = flat.size - flat.size % WORD_BYTES
        words, rest = np.frombuffer(flat.data[:whole], "<u8"), flat[whole:]
        blocks = 1 + words.size // BLOCK_WORDS
        # No symbol takes two bytes, and one of a run with what follows not more than three.
        most_bytes = 2 * flat.size + (blocks + 1) * _HEAD_BYTES
        if self._out.size < most_bytes:
            self._out = np.empty(most_bytes, np.uint8)
        body = self._out[: encode(words, rest, self._out, RUNS)].data
        return _ZLIB_HEADER, body, deflate.adler32(flat.data).to_bytes(4, "big")
