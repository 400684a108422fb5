"""Cameras, whatever their pixels hold."""

from __future__ import annotations

from typing import Any, Dict, Tuple

from carstage.collector.sensors.base import Attributes, Sensor
from carstage.rawlog.format import Buffer


class Camera(Sensor):
    """A picture, row major, exactly as the client hands it out; the table says what a pixel is."""

    one_size = True

    def expected_bytes(self, attributes: Attributes, fps: float) -> int:
        """Exact: width by height by the bytes of a pixel."""
        pixels = int(attributes["image_size_x"]) * int(attributes["image_size_y"])
        return pixels * self.datum_bytes

    def size_bytes(self, data: Any) -> int:
        """Width by height by the bytes of a pixel."""
        return int(data.width) * int(data.height) * self.datum_bytes

    def encode(self, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """Meta ``{"width", "height", "fov_deg"}``; the payload is a view into the picture."""
        meta = {"width": data.width, "height": data.height, "fov_deg": data.fov}
        return meta, memoryview(data.raw_data)
