"""PNG files whose bytes follow from their pixels: filter Up on every row, then deflate.

The chunks are the critical ones alone (IHDR, one IDAT, IEND), without time or software name.
Both encoders encode equal rows equally, as the hashes in commit markers need: libdeflate at level
1, and ours for colours, twice as fast. ISA-L was seen to encode equal rows in two ways.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Sequence

import deflate
import numpy as np
from numpy.typing import NDArray
from PIL import Image

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_IHDR = struct.Struct(">IIBBBBB")
_GREY, _RGB = 0, 2
_FILTER_UP = 2
_LEVEL = 1


Parts = Sequence[bytes | bytearray | memoryview]
"""What follows one another in a file."""


def _libdeflate(rows: NDArray[np.uint8]) -> Parts:
    return (deflate.zlib_compress(rows.data, _LEVEL),)


class PngPacker:
    """Packs images of one size and type after another, in buffers that it keeps.

    Not for use by several threads at once.

    Args:
        compress: makes a zlib stream of filtered rows, in parts.
    """

    def __init__(self, compress: Callable[[NDArray[np.uint8]], Parts] = _libdeflate) -> None:
        self._compress = compress
        self._filtered: NDArray[np.uint8] = np.empty((0, 0), np.uint8)

    def pack(self, image: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
        """One PNG file.

        Args:
            image: ``(H, W)`` or ``(H, W, 3)``, uint8 or uint16.

        Raises:
            ValueError: another shape or type.
        """
        if image.dtype == np.uint8 and image.ndim == 3 and image.shape[2] == 3:
            bits, colour, samples = 8, _RGB, image
        elif image.dtype == np.uint8 and image.ndim == 2:
            bits, colour, samples = 8, _GREY, image
        elif image.dtype == np.uint16 and image.ndim == 2:
            bits, colour, samples = 16, _GREY, image.astype(">u2").view(np.uint8)
        elif image.dtype == np.uint16 and image.ndim == 3 and image.shape[2] == 3:
            bits, colour, samples = 16, _RGB, image.astype(">u2").view(np.uint8)
        else:
            raise ValueError(f"no PNG of an array of shape {image.shape} and type {image.dtype}")
        height, width = image.shape[:2]
        filtered = self._buffer(height, samples.nbytes // max(1, height))
        rows = np.ascontiguousarray(samples).reshape(height, -1)
        filtered[0, 1:] = rows[0]
        np.subtract(rows[1:], rows[:-1], out=filtered[1:, 1:])
        return self._file(width, height, bits, colour, filtered)

    def pack_bgra(self, image: NDArray[np.uint8]) -> bytes:
        """The same file as of the colours in their order, by one pass over the picture.

        Args:
            image: ``(H, W, 4)`` blue, green, red and alpha, which is left out.

        Raises:
            ValueError: it is empty.
        """
        # Numba takes half a second to import: only processes that encode pictures shall pay.
        from carstage.codecs.bgra_kernels import filter_up

        height, width = image.shape[:2]
        filtered = self._buffer(height, 3 * width)
        filter_up(pixel_words(image), filtered)
        return self._file(width, height, 8, _RGB, filtered)

    def _buffer(self, height: int, row_bytes: int) -> NDArray[np.uint8]:
        if height < 1 or row_bytes < 1:
            raise ValueError(f"no PNG of an empty array of {height} rows of {row_bytes} bytes")
        if self._filtered.shape != (height, 1 + row_bytes):
            self._filtered = np.empty((height, 1 + row_bytes), np.uint8)
            self._filtered[:, 0] = _FILTER_UP
        return self._filtered

    def _file(
        self, width: int, height: int, bits: int, colour: int, filtered: NDArray[np.uint8]
    ) -> bytes:
        return b"".join(
            (
                _SIGNATURE,
                *_chunk(b"IHDR", [_IHDR.pack(width, height, bits, colour, 0, 0, 0)]),
                *_chunk(b"IDAT", self._compress(filtered)),
                *_chunk(b"IEND", []),
            )
        )


def pixel_words(image: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """A picture ``(H, W, 4)`` as one word for each pixel, ``(H, W)``, for compiled loops."""
    words = np.require(image, requirements=["C", "A"]).view("<u4")[..., 0]
    words.flags.writeable = False  # one type, one compilation
    return words


def _chunk(kind: bytes, data: Parts) -> Parts:
    checksum = deflate.crc32(kind)
    for part in data:
        checksum = deflate.crc32(part, checksum)
    length = sum(len(part) for part in data)
    return struct.pack(">I", length), kind, *data, struct.pack(">I", checksum)


def unpack_png(content: bytes) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """The pixels of a PNG file: ``(H, W, 3)`` or ``(H, W)`` uint8, or ``(H, W)`` uint16.

    Raises:
        ValueError: damaged, or of another pixel type.
    """
    # Pillow reports damage by whatever exception its parser meets (SyntaxError among them).
    try:
        with Image.open(io.BytesIO(content), formats=["PNG"]) as picture:
            mode = picture.mode
            pixels = np.asarray(picture)
    except (OSError, SyntaxError, ValueError, EOFError, struct.error, zlib.error) as error:
        raise ValueError(f"damaged PNG: {error}") from error
    if mode in ("L", "RGB"):
        return pixels.astype(np.uint8, copy=False)
    if mode == "I;16":
        return pixels.astype(np.uint16, copy=False)
    raise ValueError(f"a PNG of mode {mode} is none of this dataset")


def unpack_rgb16(content: bytes) -> NDArray[np.uint16]:
    """The pixels of a 16-bit RGB file of :class:`PngPacker`, ``(H, W, 3)``.

    Pillow has no such pixels. Only what the packer writes is read: one IDAT, every row filtered
    with Up.

    Raises:
        ValueError: damaged, or of another kind.
    """
    try:
        kinds = _chunks(content)
        width, height, bits, colour, *rest = _IHDR.unpack(kinds[b"IHDR"])
        if (bits, colour, rest) != (16, _RGB, [0, 0, 0]):
            raise ValueError(f"{bits} bits of colour type {colour} are no 16-bit RGB")
        rows = np.frombuffer(zlib.decompress(kinds[b"IDAT"]), np.uint8).reshape(height, -1)
        if rows.shape[1] != 1 + 6 * width or (rows[:, 0] != _FILTER_UP).any():
            raise ValueError("rows of another length or filter")
    except (KeyError, ValueError, struct.error, zlib.error) as error:
        raise ValueError(f"damaged PNG: {error}") from error
    samples = np.cumsum(rows[:, 1:], axis=0, dtype=np.uint8)
    return samples.view(">u2").reshape(height, width, 3).astype(np.uint16)


def _chunks(content: bytes) -> dict[bytes, bytes]:
    """The chunks of a PNG file by kind, each of which comes once."""
    if not content.startswith(_SIGNATURE):
        raise ValueError("no signature")
    found: dict[bytes, bytes] = {}
    offset = len(_SIGNATURE)
    while b"IEND" not in found:
        (length,) = struct.unpack_from(">I", content, offset)
        kind = content[offset + 4 : offset + 8]
        data = content[offset + 8 : offset + 8 + length]
        (checksum,) = struct.unpack_from(">I", content, offset + 8 + length)
        if kind in found or zlib.crc32(kind + data) != checksum:
            raise ValueError(f"chunk {kind!r} is damaged")
        found[kind] = data
        offset += 12 + length
    return found
