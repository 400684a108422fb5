"""Pixels of CARLA's depth and instance cameras, from raw BGRA bytes to metres and ids."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage.errors import AnnotationError
from carstage.sensor_kinds.columns import Bgra

DEPTH_STEP_M = 1000.0 / (2**24 - 1)
"""Metres per step of the 24-bit depth code (CARLA docs, ``sensor.camera.depth``)."""

NO_HIT_M = 999.9
"""A depth from here on is the far plane: nothing was hit."""


def _bgra(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 4:
        raise AnnotationError(
            f"A camera image has shape {image.shape} and type {image.dtype}; "
            "BGRA (height, width, 4) uint8 is needed."
        )
    return np.ascontiguousarray(image)


def decode_depth_bgra(image_bgra: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Distance along the optical axis (m) of a raw depth image.

    ``1000 (R + 256 G + 65536 B) / (2^24 - 1)`` (CARLA docs; equation 1 of the paper). BGRA read
    as a big-endian word is ``B << 24 | G << 16 | R << 8 | A``: one shift gives the code.

    Args:
        image_bgra: ``(H, W, 4)`` uint8.

    Returns:
        ``(H, W)`` float32, 0 to 1000; computed in float64, then rounded.
    """
    code = _bgra(image_bgra).view(">u4")[..., 0].astype(np.uint32) >> np.uint32(8)
    return (code * DEPTH_STEP_M).astype(np.float32)


def decode_instance_bgra(
    image_bgra: NDArray[np.uint8],
) -> tuple[NDArray[np.uint16], NDArray[np.uint8]]:
    """Instance ids and tags of a raw instance image.

    Args:
        image_bgra: ``(H, W, 4)`` uint8.

    Returns:
        ``(H, W)`` uint16, the low 16 bits of the id (``G + 256 B``), and ``(H, W)`` uint8, the
        semantic tag (``R``).
    """
    pixels = _bgra(image_bgra)
    return pixels.view(">u2")[..., 0].astype(np.uint16), pixels[..., Bgra.RED].copy()
