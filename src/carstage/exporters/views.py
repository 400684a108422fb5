"""Cameras with the car that carries them: what formats export that have one camera in a frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.dataset import Episode, SensorCalibration
from carstage.dataset.saved_frames import Frame
from carstage.exporters.cars import Car, car_lidar, cars_with_sensors
from carstage.exporters.clouds import read_points
from carstage.exporters.options import ExportOptions
from carstage.exporters.rigs import colour_cameras, main_lidar
from carstage.geometry import FloatArray, invert_pose

ALL_CAMERAS: Final = ("all",)
"""In place of ids: every camera."""


@dataclass(frozen=True, slots=True)
class View:
    """A camera, and what is exported with its pictures.

    Attributes:
        camera: the camera.
        car: the vehicle that it sits on rigidly; ``None``: on none.
        lidar: of that vehicle, of the ego for cameras on none; a semantic one measures no
            intensity.
    """

    camera: SensorCalibration
    car: Car | None
    lidar: SensorCalibration | None

    @property
    def is_on_ego(self) -> bool:
        """Whether it is told relative to the ego."""
        return self.car is None or self.car.is_ego

    def frame(self, frame: Frame) -> Frame:
        """The frame with the surroundings of its car."""
        return frame if self.car is None else self.car.frame(frame)

    def car_from_sensor(self, frame: Frame, sensor_id: str) -> FloatArray:
        """``(4, 4)`` pose of a sensor in the car's frame, CARLA's axes.

        Args:
            frame: as it was recorded.
            sensor_id: whose pose.
        """
        if self.car is None or self.car.is_ego:
            return frame.ego_from_sensor(sensor_id)
        world_from_car = self.car.world_from_car(frame)
        return invert_pose(world_from_car) @ frame.world_from_sensor(sensor_id)

    def points(self, frame: Frame) -> NDArray[np.float32] | None:
        """``(N, 4)`` x, y, z (m), intensity of its LiDAR; ``None`` without data."""
        if self.lidar is None or not frame.has(self.lidar.id):
            return None
        return read_points(frame, self.lidar.id)


def chosen_views(episode: Episode, options: ExportOptions) -> tuple[View, ...]:
    """The cameras that the options name, by default the first; ``all``: every labelled one.

    Raises:
        BadInputError: there is none, or one that is named is no labelled colour camera.
    """
    if options.cameras == ALL_CAMERAS:
        cameras: Sequence[SensorCalibration] = colour_cameras(
            episode, replace(options, cameras=()), pinholes=True
        )
    else:
        cameras = colour_cameras(episode, options, pinholes=True)[: len(options.cameras) or 1]
    cars = {sensor.id: car for car in cars_with_sensors(episode) for sensor in car.sensors}
    return tuple(_view(episode, camera, cars.get(camera.id), options) for camera in cameras)


def _view(
    episode: Episode, camera: SensorCalibration, car: Car | None, options: ExportOptions
) -> View:
    if car is None or car.is_ego:
        return View(camera, car, main_lidar(episode, options))
    return View(camera, car, car_lidar(car, options))
