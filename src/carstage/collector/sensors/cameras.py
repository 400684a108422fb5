"""Cameras: BGRA pictures of colour, depth, tags, ids and normals; optical flow in float32."""

from __future__ import annotations

from typing import Any, Dict, Tuple

from carstage.collector.sensors.base import Attributes, Sensor, register
from carstage.rawlog.format import Buffer


class Camera(Sensor):
    """A picture of ``4 W H`` bytes, BGRA, row major, exactly as the client hands it out."""

    bytes_per_pixel = 4
    one_size = True

    @classmethod
    def expected_bytes(cls, attributes: Attributes, fps: float) -> int:
        """Exact: width by height by the bytes of a pixel."""
        pixels = int(attributes["image_size_x"]) * int(attributes["image_size_y"])
        return pixels * cls.bytes_per_pixel

    @classmethod
    def size_bytes(cls, data: Any) -> int:
        """Width by height by the bytes of a pixel."""
        return int(data.width) * int(data.height) * cls.bytes_per_pixel

    @classmethod
    def encode(cls, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """Meta ``{"width", "height", "fov_deg"}``; the payload is a view into the picture."""
        meta = {"width": data.width, "height": data.height, "fov_deg": data.fov}
        return meta, memoryview(data.raw_data)


@register("rgb")
class RgbCamera(Camera):
    """``sensor.camera.rgb``."""


@register("depth")
class DepthCamera(Camera):
    """``sensor.camera.depth``: 24-bit depth along the optical axis in R, G, B."""


@register("semantic")
class SemanticCamera(Camera):
    """``sensor.camera.semantic_segmentation``: the tag in R."""


@register("instance")
class InstanceCamera(Camera):
    """``sensor.camera.instance_segmentation``: the tag in R, the low 16 bits of the id in G, B."""


@register("normals")
class NormalsCamera(Camera):
    """``sensor.camera.normals``: the normal's x, y, z in R, G, B, from -1 to 1."""


@register("flow")
class FlowCamera(Camera):
    """``sensor.camera.optical_flow``: two float32 per pixel, in shares of the image."""

    bytes_per_pixel = 8
