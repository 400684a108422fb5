"""The layers of convolutional networks in numpy: arrays are ``(H, W, C)`` float32."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array = NDArray[np.float32]


def same_padding(size: int, kernel: int, stride: int) -> tuple[int, int]:
    """Cells before and after, so that ``ceil(size / stride)`` results remain; more after.

    The rule of TensorFlow's padding ``SAME``.
    """
    missing = max((-(-size // stride) - 1) * stride + kernel - size, 0)
    return missing // 2, missing - missing // 2


def padded(values: Array, kernel: tuple[int, int], stride: int, fill: float = 0.0) -> Array:
    """An array with :func:`same_padding` around it."""
    around = [same_padding(values.shape[k], kernel[k], stride) for k in range(2)]
    if not any(map(any, around)):
        return values
    return np.pad(values, (*around, (0, 0)), constant_values=fill)


def convolve(values: Array, weights: Array, stride: int = 1) -> Array:
    """A convolution with padding ``SAME``.

    Args:
        values: ``(H, W, C)``.
        weights: ``(kernel rows, kernel columns, C, outputs)``.
        stride: of both axes.
    """
    rows, columns, channels, outputs = weights.shape
    wide = padded(values, (rows, columns), stride)
    if rows == columns == 1:
        patches = wide[::stride, ::stride]
    else:
        patches = sliding_window_view(wide, (rows, columns), axis=(0, 1))[::stride, ::stride]
        patches = patches.transpose(0, 1, 3, 4, 2)
    height, width = patches.shape[:2]
    flat = patches.reshape(height * width, rows * columns * channels)
    found: Array = (flat @ weights.reshape(-1, outputs)).reshape(height, width, outputs)
    return found


def convolve_each(values: Array, weights: Array, stride: int = 1) -> Array:
    """A convolution of each channel by itself, with padding ``SAME``.

    Args:
        values: ``(H, W, C)``.
        weights: ``(kernel rows, kernel columns, C)``.
        stride: of both axes.
    """
    rows, columns, _ = weights.shape
    wide = padded(values, (rows, columns), stride)
    height, width = (-(-values.shape[k] // stride) for k in range(2))
    found = np.zeros((height, width, values.shape[2]), np.float32)
    for i in range(rows):
        for j in range(columns):
            part = wide[i : i + stride * (height - 1) + 1 : stride]
            found += part[:, j : j + stride * (width - 1) + 1 : stride] * weights[i, j]
    return found


def largest(values: Array, size: int) -> Array:
    """The largest value around each cell, with padding ``SAME``."""
    wide = padded(values, (size, size), 1, -np.inf)
    height, width = values.shape[:2]
    found = np.full(values.shape, -np.inf, np.float32)
    for i in range(size):
        for j in range(size):
            np.maximum(found, wide[i : i + height, j : j + width], out=found)
    return found


def resize_bilinear(values: Array, height: int, width: int) -> Array:
    """Larger or smaller by linear interpolation; corners are where they were (TensorFlow 1)."""
    resized = values
    for axis, count in enumerate((height, width)):
        size = resized.shape[axis]
        place = np.arange(count) * (size / count)
        low = np.floor(place).astype(np.int64)
        shape = [1, 1, 1]
        shape[axis] = count
        share = (place - low).astype(np.float32).reshape(shape)
        below = resized.take(low, axis)
        above = resized.take(np.minimum(low + 1, size - 1), axis)
        resized = below + (above - below) * share
    return resized


def sigmoid(values: Array) -> Array:
    """``1 / (1 + exp(-x))`` without overflow."""
    found: Array = (0.5 + 0.5 * np.tanh(0.5 * values)).astype(np.float32)
    return found
