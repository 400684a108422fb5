"""Cameras whose pictures have rows of labels that a check makes again."""

from __future__ import annotations

from typing import NamedTuple

from carstage.dataset.reading import Episode, Sensor


class LabelledCameras(NamedTuple):
    """Labelled pinhole cameras of an episode.

    Attributes:
        cameras: by id.
        depth: by the id of a camera, the depth camera beside it, where its images are exact.
    """

    cameras: dict[str, Sensor]
    depth: dict[str, Sensor]

    @classmethod
    def of(cls, episode: Episode) -> LabelledCameras:
        """Those of an episode."""
        sensors = {sensor.id: sensor for sensor in episode.sensors}
        cameras = {
            name: sensor
            for name, sensor in sensors.items()
            if sensor.calibration.labelled and sensor.calibration.is_pinhole
        }
        depth = {
            name: beside
            for name, sensor in cameras.items()
            if (beside := sensors.get(sensor.calibration.depth or "")) is not None
            and beside.calibration.is_lossless
        }
        return cls(cameras, depth)
