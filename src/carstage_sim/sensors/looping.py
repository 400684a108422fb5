"""A sensor that repeats itself: real data at the price of sending them."""

from __future__ import annotations

from collections.abc import Sequence

from carstage_sim.maps.town import Town
from carstage_sim.sensors.frames import SensorFrame, SensorRequest
from carstage_sim.sensors.sensor import Sensor
from carstage_sim.sensors.view import View
from carstage_sim.world.state import WorldState


class LoopingSensor(Sensor):
    """Lets another sensor measure a number of times, then sends that again in turn.

    Frame numbers, times and poses are those of the tick; only the data come from earlier ones. A
    tick in which the sensor had nothing to send is repeated as such.

    Args:
        sensor: measures.
        request, town: as for every sensor.
        count: how many reports there are until they repeat.
    """

    def __init__(self, sensor: Sensor, request: SensorRequest, town: Town, count: int) -> None:
        super().__init__(request, town)
        self._sensor = sensor
        self._count = count
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
            self._reports.append(self._sensor.report(state, request, view))
            return self._reports[-1]
        report = self._reports[self._next]
        self._next = (self._next + 1) % self._count
        return report
