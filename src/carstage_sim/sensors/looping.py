"""A sensor that repeats itself: real data at the price of sending them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import Town
from carstage_sim.sensors.measurements import ImageFrame, SensorFrame, SensorRequest
from carstage_sim.sensors.sensor import Sensor
from carstage_sim.sensors.view import View
from carstage_sim.world.state import WorldState

_COLOUR_CAMERA = "sensor.camera.rgb"


@dataclass(frozen=True, slots=True)
class Looping:
    """How sensors repeat themselves.

    Attributes:
        count: how many reports there are until they repeat.
        noise: standard deviation of what is added to colour pictures, in steps of 0 to 255. Drawn
            pictures are smoother than those of a camera, and so are cheaper to compress.
    """

    count: int
    noise: float = 0.0


class LoopingSensor(Sensor):
    """Lets another sensor measure a number of times, then sends that again in turn.

    Frame numbers, times and poses are those of the tick; only the data come from earlier ones. A
    tick in which the sensor had nothing to send is repeated as such.

    Args:
        sensor: measures.
        request, town: as for every sensor.
        looping: how often it measures, and what is added.
    """

    def __init__(
        self, sensor: Sensor, request: SensorRequest, town: Town, looping: Looping
    ) -> None:
        super().__init__(request, town)
        self._sensor = sensor
        self._count = looping.count
        self._noise = looping.noise if request.type_id == _COLOUR_CAMERA else 0.0
        self._reports: list[Sequence[SensorFrame]] = []
        self._next = 0

    def observe(self, state: WorldState, request: SensorRequest) -> None:
        """Let the sensor see the tick while it still measures."""
        if len(self._reports) < self._count:
            self._sensor.observe(state, request)

    def report(
        self, state: WorldState, request: SensorRequest, view: View
    ) -> Sequence[SensorFrame]:
        """A new report while there are too few of them, else the one that is next."""
        if len(self._reports) < self._count:
            frames = self._sensor.report(state, request, view)
            self._reports.append([self._noisy(frame, request.sensor_id) for frame in frames])
            return self._reports[-1]
        report = self._reports[self._next]
        self._next = (self._next + 1) % self._count
        return report

    def _noisy(self, frame: SensorFrame, sensor_id: int) -> SensorFrame:
        if self._noise == 0.0 or not isinstance(frame, ImageFrame):
            return frame
        # Ids of a camera's buffers are below 0.
        random = np.random.default_rng([sensor_id & 0xFFFFFFFF, len(self._reports)])
        return dataclasses.replace(frame, pixels=with_noise(frame.pixels, self._noise, random))


def with_noise(
    pixels: NDArray[np.uint8], sigma: float, random: np.random.Generator
) -> NDArray[np.uint8]:
    """Pixels ``(H, W, 4)`` with normal noise on B, G and R, rounded and clipped; A stays."""
    noisy = pixels.copy()
    added = random.standard_normal((*pixels.shape[:2], 3), dtype=np.float32) * np.float32(sigma)
    np.clip(np.rint(pixels[..., :3] + added), 0, 255, out=added)
    noisy[..., :3] = added
    return noisy
