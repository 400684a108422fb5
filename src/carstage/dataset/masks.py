"""Masks of the label tables: COCO's compressed run lengths, decoded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage.errors import DatasetError

_OFFSET = 48
_MORE = 0x20
_SIGN = 0x10


def decode_mask(counts: str, height: int, width: int) -> NDArray[np.bool_]:
    """A mask from the string of column ``mask_modal``.

    The format is ``pycocotools``' (``maskApi.c``): column-major run lengths that begin with
    zeros, from the fourth on as the difference to the one two before, in groups of five bits.

    Args:
        counts: the string.
        height: of the camera's image (px).
        width: of the camera's image (px).

    Returns:
        ``(height, width)`` bool.

    Raises:
        DatasetError: the string is damaged or of an image of another size.
    """
    runs = _runs(counts, height, width)
    values = np.arange(len(runs)) % 2 == 1
    return np.repeat(values, runs).reshape(width, height).T


def mask_pixels(
    counts: str, height: int, width: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the pixels of a mask, column by column; see :func:`decode_mask`.

    Raises:
        DatasetError: the string is damaged or of an image of another size.
    """
    runs = np.array(_runs(counts, height, width), np.int64)
    ends = np.cumsum(runs)[1::2]
    lengths = runs[1::2]
    before = np.cumsum(lengths) - lengths
    places = np.arange(lengths.sum()) + np.repeat(ends - lengths - before, lengths)
    columns, rows = np.divmod(places, max(height, 1))
    return rows, columns


def _runs(counts: str, height: int, width: int) -> list[int]:
    runs: list[int] = []
    value = shift = 0
    for byte in counts.encode("ascii", "replace"):
        group = byte - _OFFSET
        if not 0 <= group < 64:
            raise DatasetError(f"A mask holds the character {chr(byte)!r}, which no mask can hold.")
        value |= (group & 0x1F) << shift
        shift += 5
        if group & _MORE:
            continue
        if group & _SIGN:
            value -= 1 << shift
        runs.append(value + runs[-2] if len(runs) > 2 else value)
        value = shift = 0
    if shift or any(run < 0 for run in runs) or sum(runs) != height * width:
        raise DatasetError(f"A mask does not fill an image of {width}x{height} pixels.")
    return runs
