"""The event camera: pixels that report when their brightness has changed by a step.

CARLA's ``DVSCamera.cpp``, which follows ESIM (Rebecq et al. 2018): between two pictures the (log)
brightness of a pixel is taken as linear in time, and every crossing of a threshold is an event.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import Town
from carstage_sim.sensors.attributes import flag, number, require, whole
from carstage_sim.sensors.cameras import CameraSensor, film_of
from carstage_sim.sensors.measurements import DVS_EVENT, DvsFrame, SensorRequest
from carstage_sim.sensors.noise import noise_stream
from carstage_sim.sensors.sensor import SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import WorldState

_GREY = np.array([0.2989, 0.587, 0.114])
"""Weights of R, G, B."""
_UNCHANGED = 1e-6
_SMALLEST_THRESHOLD = 0.01
_MOST_GREY = 255.0
_MOST_CROSSINGS = 1000
"""Of a pixel between two pictures; each takes a pass over all that still cross."""

FloatArray = NDArray[np.float64]


@SensorRegistry.register("sensor.camera.dvs")
class DvsCamera(CameraSensor):
    """Events since the last picture, in the order of their times; none is sent when there are none.

    The first picture only sets the levels that later ones are compared with. Where pictures were
    left out, brightness is taken as linear from the last one that was made.
    """

    may_be_late = True

    def __init__(self, request: SensorRequest, town: Town) -> None:
        super().__init__(request, town)
        a = request.attributes
        self.film = film_of(a)
        self.thresholds = (
            number(a, "negative_threshold", 0.3),
            number(a, "positive_threshold", 0.3),
        )
        self.sigmas = (
            number(a, "sigma_negative_threshold", 0.0),
            number(a, "sigma_positive_threshold", 0.0),
        )
        self.refractory_ns = whole(a, "refractory_period_ns", 0)
        self.use_log = flag(a, "use_log", default=True)
        self.log_eps = number(a, "log_eps", 0.001)
        require(min(self.sigmas) >= 0.0, "sigma of a threshold must not be negative")
        require(self.log_eps > 0.0, "log_eps must be positive")
        span = math.log(1.0 + 1.0 / self.log_eps) if self.use_log else _MOST_GREY
        self._smallest = span / _MOST_CROSSINGS
        for name, value in zip(("negative", "positive"), self.thresholds, strict=True):
            require(
                value >= self._smallest,
                f"{name}_threshold is {value:g}, not at least {self._smallest:.3g}: from black to "
                f"white a pixel crosses at most {_MOST_CROSSINGS}",
            )
        self._before: FloatArray | None = None
        self._level: FloatArray = np.zeros(0)
        self._last_event_ns: NDArray[np.int64] = np.zeros(0, np.int64)
        self._time_ns = 0

    def measure(self, state: WorldState, request: SensorRequest, view: View) -> DvsFrame | None:
        """The events, if there are any."""
        now = self._brightness(view.colours(self.camera(request), self.film))
        now_ns = round(state.timestamp_s * 1e9)
        if self._before is None:
            self._level = now.copy()
            self._last_event_ns = np.full(len(now), -1, np.int64)
            events = np.zeros(0, DVS_EVENT)
        else:
            random = noise_stream(0, request, state)
            events = self._events(self._before, now, now_ns - self._time_ns, random)
        self._before, self._time_ns = now, now_ns
        if not len(events):
            return None
        return DvsFrame(self.width, self.height, self.fov_deg, events)

    def _brightness(self, colours: NDArray[np.uint8]) -> FloatArray:
        """``(H * W,)`` grey value, 0 to 255, or its logarithm over 255."""
        pixels = colours.reshape(-1, 3).astype(np.float64)
        red, green, blue = _GREY
        grey: FloatArray = pixels[:, 0] * red + pixels[:, 1] * green + pixels[:, 2] * blue
        if self.use_log:
            grey = np.log(self.log_eps + grey / 255.0)
        return grey

    def _events(
        self, before: FloatArray, now: FloatArray, delta_ns: int, random: np.random.Generator
    ) -> NDArray[np.void]:
        """Crossings of all pixels; moves the levels to where each stopped."""
        (pixel,) = np.nonzero(np.abs(now - before) > _UNCHANGED)
        brighter = now[pixel] >= before[pixel]
        step = np.where(brighter, self.thresholds[1], self.thresholds[0])
        sigma = np.where(brighter, self.sigmas[1], self.sigmas[0])
        if max(self.sigmas) > 0.0:
            noisy = step + random.normal(size=len(pixel)) * sigma
            noisy = np.maximum(noisy, max(_SMALLEST_THRESHOLD, self._smallest))
            step = np.where(sigma > 0.0, noisy, step)
        step = np.where(brighter, step, -step)
        level = self._level[pixel]
        found = []
        while len(pixel):
            level = level + step
            start, end = before[pixel], now[pixel]
            crossed = np.where(brighter, level <= end, level >= end)
            pixel, level = pixel[crossed], level[crossed]
            step, brighter = step[crossed], brighter[crossed]
            # A noisy threshold may have been passed before: then at once, where CARLA's pixel
            # would be stuck for good.
            share = np.maximum((level - start[crossed]) / (end[crossed] - start[crossed]), 0.0)
            time_ns = self._time_ns + (share * delta_ns).astype(np.int64)
            self._level[pixel] = level
            last_ns = self._last_event_ns[pixel]
            rested = (last_ns < 0) | (time_ns - last_ns >= self.refractory_ns)
            self._last_event_ns[pixel[rested]] = time_ns[rested]
            events = np.empty(int(rested.sum()), DVS_EVENT)
            events["x"] = pixel[rested] % self.width
            events["y"] = pixel[rested] // self.width
            events["t"] = time_ns[rested]
            events["pol"] = brighter[rested]
            found.append(events)
        if not found:
            return np.zeros(0, DVS_EVENT)
        together = np.concatenate(found)
        return together[np.lexsort((together["x"], together["y"], together["t"]))]
