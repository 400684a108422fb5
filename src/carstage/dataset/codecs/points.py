"""Codecs of the ranging sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.codecs.codec import Codec, register

_POINT_BYTES = 16


@register("lidar", "bin", default=True)
class LidarBin(Codec):
    """The points as they were measured; decodes to ``(N, 4)`` float32 x, y, z (m), intensity.

    Coordinates are of the sensor in CARLA's axes: x forward, y right, z up.
    """

    suffixes: ClassVar = (".bin",)

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        points = _points(payload)
        counts = meta.get("counts")
        if counts is not None and sum(counts) != len(points):
            raise ValueError(f"a LiDAR record says {sum(counts)} points and holds {len(points)}")
        return (bytes(payload),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        return _points(contents[0])

    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """See ``Codec.raw_array``."""
        return _points(payload)


def _points(content: bytes | memoryview) -> NDArray[np.float32]:
    if len(content) % _POINT_BYTES:
        raise ValueError(f"{len(content)} bytes are no whole number of points")
    points = np.frombuffer(content, "<f4").reshape(-1, 4)
    if not np.isfinite(points).all():
        raise ValueError("a coordinate is not finite")
    return points
