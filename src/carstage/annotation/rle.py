"""Binary masks as COCO's compressed run lengths.

The format of ``pycocotools``' ``maskApi.c``: run lengths of the column-major image, beginning
with zeros; from the fourth on the difference to the one two before; each as little-endian groups
of five bits plus a continuation bit, offset by 48 into printable ASCII.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def run_lengths(crop: NDArray[np.bool_], x0: int, y0: int, width: int, height: int) -> list[int]:
    """Column-major run lengths of a whole mask of which only a crop is set.

    Args:
        crop: ``(h, w)`` mask; its first pixel is (x0, y0) of the image.
        x0: column of the crop in the image.
        y0: row of the crop in the image.
        width: of the image (px).
        height: of the image (px).

    Returns:
        Counts of zeros, ones, zeros, ...; the first may be 0; they sum to ``width * height``.
    """
    rows, columns = crop.shape
    # Each column with a zero below, so that a run ends with its column; and one zero before all.
    padded = np.zeros(columns * (rows + 1) + 1, dtype=np.bool_)
    padded[1:].reshape(columns, rows + 1)[:, :rows] = crop.T
    column, row = np.divmod(np.flatnonzero(padded[1:] != padded[:-1]), rows + 1)
    edges = (column + x0) * height + (row + y0)
    # A run that ends where the next begins goes on into the next column.
    touching = np.flatnonzero(edges[1:-1:2] == edges[2::2])
    edges = np.delete(edges, np.concatenate([2 * touching + 1, 2 * touching + 2]))
    if not len(edges):
        return [width * height]
    counts: list[int] = np.diff(edges, prepend=0).tolist()
    tail = width * height - int(edges[-1])
    return [*counts, tail] if tail else counts


def compress(counts: list[int]) -> str:
    """COCO's ``counts`` string of run lengths."""
    value = np.array(counts, dtype=np.int64)
    value[3:] -= np.array(counts[1:-2], dtype=np.int64)
    characters = np.zeros((len(value), 7), dtype=np.uint8)
    written = np.zeros((len(value), 7), dtype=np.bool_)
    active = np.ones(len(value), dtype=np.bool_)
    for group in range(7):
        bits = value & 0x1F
        value >>= 5
        more = np.where(bits & 0x10, value != -1, value != 0)
        characters[:, group] = bits + 48 + np.where(more, 0x20, 0)
        written[:, group] = active
        active &= more
    return characters[written].tobytes().decode("ascii")


def encode_mask(crop: NDArray[np.bool_], x0: int, y0: int, width: int, height: int) -> str:
    """COCO's ``counts`` string of a mask; arguments as in ``run_lengths``."""
    return compress(run_lengths(crop, x0, y0, width, height))
