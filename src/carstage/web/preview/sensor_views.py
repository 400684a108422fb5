"""What a sensor's data look like: pictures in colours, points; for previews and the player.

Imports numpy and Pillow: only for processes and requests that draw.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from carstage.annotation.point_sensors import radar_points
from carstage.report.drawing import RgbColour
from carstage.sensor_kinds.model import DETECTIONS, TAGGED_POINTS
from carstage.tags import TAGS_0_9_14

PALETTE: Mapping[int, RgbColour] = {value: tag.rgb for value, tag in TAGS_0_9_14.items()}


def points_of(content: str, data: NDArray[Any]) -> NDArray[np.float32]:
    """``(N, 4)`` float32 x, y, z in the sensor's axes, and intensity, tag or range rate."""
    if content == DETECTIONS:
        rates = data[:, :1].astype(np.float64)
        return np.hstack([radar_points(data), rates]).astype("<f4")
    if content == TAGGED_POINTS:
        columns = [data["x"], data["y"], data["z"], data["object_tag"]]
        return np.stack(columns, axis=1).astype("<f4")
    return np.ascontiguousarray(data[:, :4], "<f4")


def scaled(image: Image.Image, width: int) -> Image.Image:
    """The picture, at most ``width`` wide."""
    if image.width <= width:
        return image
    height = max(1, round(image.height * width / image.width))
    return image.resize((width, height), Image.Resampling.BOX)


def jpeg(image: Image.Image, quality: int = 78) -> bytes:
    """The picture as JPEG."""
    stream = io.BytesIO()
    image.convert("RGB").save(stream, format="JPEG", quality=quality)
    return stream.getvalue()


def png(image: Image.Image) -> bytes:
    """The picture as PNG; quickly, not small."""
    stream = io.BytesIO()
    image.save(stream, format="PNG", compress_level=1)
    return stream.getvalue()
