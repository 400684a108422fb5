"""Exposure that follows a change of the weather as fast as a camera's attributes allow.

It is a function of which weather there was when, not of when pictures were made: cameras that rest
in some steps are exposed as if they did not.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

from carstage_sim.sensors.attributes import number
from carstage_sim.world.state import Weather, WorldState

_MOST_NOTED = 1024
"""Changes of the weather in steps that show nothing; older ones are forgotten."""


class Adaptation:
    """A camera's exposure over time, in stops; the first is what the light asks for.

    Args:
        speed_up: stops per second towards a brighter scene; 0 or less: never.
        speed_down: the same towards a darker one.
    """

    def __init__(self, speed_up: float, speed_down: float) -> None:
        self._speed_up, self._speed_down = max(speed_up, 0.0), max(speed_down, 0.0)
        self._noted: deque[tuple[float, Weather]] = deque(maxlen=_MOST_NOTED)
        self._weather: Weather | None = None
        self._begin_s = self._stops = self._target = 0.0

    @classmethod
    def of(cls, attributes: Mapping[str, str]) -> Adaptation:
        """That of a camera with CARLA's attributes.

        Raises:
            SensorAttributeError: a speed is no number.
        """
        up = number(attributes, "exposure_speed_up", 3.0)
        return cls(up, number(attributes, "exposure_speed_down", 1.0))

    def note(self, state: WorldState) -> None:
        """Note the weather of a step that shows nothing."""
        last = self._noted[-1][1] if self._noted else self._weather
        if state.weather != last:
            self._noted.append((state.timestamp_s - state.delta_s, state.weather))

    def stops(self, state: WorldState, wanted: Callable[[Weather], float]) -> float:
        """The exposure of a step's picture.

        Args:
            state: the step, later than that of the picture before, or the same.
            wanted: gives what a weather asks for: the brighter it is, the less.
        """
        while self._noted and self._noted[0][0] < state.timestamp_s:
            self._turn(*self._noted.popleft(), wanted)
        if self._weather is None:
            self._stops = self._target = wanted(state.weather)
            self._weather = state.weather
        # The weather was changed before the step began.
        self._turn(state.timestamp_s - state.delta_s, state.weather, wanted)
        return self._at(state.timestamp_s)

    def _turn(self, begin_s: float, weather: Weather, wanted: Callable[[Weather], float]) -> None:
        """Head for what another weather asks for, from a time on."""
        if self._weather is None or weather == self._weather:
            return
        self._stops = self._at(begin_s)
        self._begin_s, self._weather, self._target = begin_s, weather, wanted(weather)

    def _at(self, time_s: float) -> float:
        way = self._target - self._stops
        speed = self._speed_down if way > 0.0 else self._speed_up
        step = speed * max(time_s - self._begin_s, 0.0)
        if abs(way) <= step:
            return self._target
        return self._stops + (step if way > 0.0 else -step)
