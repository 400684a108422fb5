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

from carstage.report.drawing import (
    RgbColour,
    depth_view,
    flow_view,
    instance_view,
    radar_xyz,
    semantic_view,
)
from carstage.tags import TAGS_0_9_14

IMAGE_KINDS = frozenset({"rgb", "depth", "semantic", "instance", "flow", "normals"})
POINT_KINDS = frozenset({"lidar", "semantic_lidar"})
RADAR = "radar"
PALETTE: Mapping[int, RgbColour] = {value: tag.rgb for value, tag in TAGS_0_9_14.items()}


def picture(
    kind: str, data: NDArray[Any], palette: Mapping[int, RgbColour] = PALETTE
) -> Image.Image:
    """A camera's data, as ``carstage.dataset.Sensor.read`` gives them, in colours.

    Args:
        kind: of the camera.
        data: ``(H, W, ...)``.
        palette: colour of each semantic tag.
    """
    if kind == "depth":
        return depth_view(data)
    if kind == "semantic":
        return semantic_view(data, palette)
    if kind == "instance":
        return instance_view(data)
    if kind == "flow":
        return flow_view(np.nan_to_num(data))
    return Image.fromarray(np.ascontiguousarray(data))


def points_of(kind: str, data: NDArray[Any]) -> NDArray[np.float32]:
    """``(N, 4)`` float32 x, y, z in the sensor's axes, and intensity, tag or range rate."""
    if kind == RADAR:
        rates = data[:, :1].astype(np.float64)
        return np.hstack([radar_xyz(data), rates]).astype("<f4")
    if kind == "semantic_lidar":
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
