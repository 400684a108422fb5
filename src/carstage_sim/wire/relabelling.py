"""Semantic labels in sensor data, as a dialect numbers them.

The simulation knows one numbering. What a client of another version gets is translated here, where
bytes leave the server, on copies: frames may be shared between listeners.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from carstage_sim.sensors.measurements import ImageFrame, SemanticLidarFrame, SensorFrame

_TAG_CHANNEL = 2
"""Of BGRA: the tag is in R."""

_Table = NDArray[np.uint8]
_Relabel = Callable[[Any, _Table], Any]


def _image(frame: ImageFrame, table: _Table) -> ImageFrame:
    pixels = frame.pixels.copy()
    pixels[..., _TAG_CHANNEL] = table[pixels[..., _TAG_CHANNEL]]
    return replace(frame, pixels=pixels)


def _points(frame: SemanticLidarFrame, table: _Table) -> SemanticLidarFrame:
    points = frame.points.copy()
    points["object_tag"] = table[points["object_tag"]]
    return replace(frame, points=points)


_TAGGED: Mapping[str, _Relabel] = {
    "sensor.camera.semantic_segmentation": _image,
    "sensor.camera.instance_segmentation": _image,
    "sensor.lidar.ray_cast_semantic": _points,
    "sensor.lidar.ray_cast_flash": _points,
    "sensor.other.occupancy": _points,
}


def label_table(labels: Mapping[int, int]) -> _Table:
    """``(256,)`` uint8: this version's number of each label."""
    table = np.arange(256, dtype=np.uint8)
    for label, number in labels.items():
        table[label] = number
    return table


class Relabelling:
    """Translates frames by one dialect's labels.

    Args:
        labels: semantic label of the simulation -> the dialect's, where they differ.
    """

    def __init__(self, labels: Mapping[int, int]) -> None:
        self._table = label_table(labels) if labels else None

    def __call__(self, type_id: str, frame: SensorFrame) -> SensorFrame:
        """The frame with the dialect's labels; itself where there is nothing to translate.

        ``type_id`` is the sensor's own: what is sent in another's messages may have no labels.
        """
        relabel = _TAGGED.get(type_id)
        if self._table is None or relabel is None:
            return frame
        return cast(SensorFrame, relabel(frame, self._table))
