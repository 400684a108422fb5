"""The sensors of a world that remember earlier ticks, by their ids."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from carstage_sim.maps.town import Town
from carstage_sim.sensors.looping import Looping, LoopingSensor
from carstage_sim.sensors.measurements import SensorRequest
from carstage_sim.sensors.sensor import Sensor, SensorRegistry
from carstage_sim.world.state import WorldState


class KnownSensors:
    """Makes sensors when they are first asked for, and forgets them when they no longer are.

    All are forgotten when the frame number goes back: a new episode counts ids anew.

    Args:
        town: the map.
        loop: how each sensor repeats itself; None: it measures for ever.
    """

    def __init__(self, town: Town, loop: Looping | None = None) -> None:
        self._town = town
        self._loop = loop
        self._sensors: dict[int, Sensor] = {}
        self._last_frame = -1

    def reset(self) -> None:
        """Forget all sensors."""
        self._sensors.clear()
        self._last_frame = -1

    def due(
        self,
        state: WorldState,
        requests: Sequence[SensorRequest],
        settle: Callable[[int], None] = lambda sensor_id: None,
    ) -> list[tuple[SensorRequest, Sensor]]:
        """The sensors whose turn it is, in the order of the requests; the others see the tick.

        Args:
            state: the tick.
            requests: of all sensors.
            settle: waits until a sensor's earlier frames are made.

        Raises:
            KeyError: a request's blueprint id is not a known sensor.
            SensorAttributeError: an attribute of a new sensor has an impossible value.
        """
        if state.frame <= self._last_frame:
            self.reset()
        self._last_frame = state.frame
        present = {request.sensor_id for request in requests}
        self._sensors = {known: one for known, one in self._sensors.items() if known in present}
        due: list[tuple[SensorRequest, Sensor]] = []
        for request in requests:
            sensor = self._sensors.get(request.sensor_id)
            if sensor is None or not sensor.answers(request):
                sensor = self._sensors[request.sensor_id] = self._made(request)
            if sensor.is_due(state.timestamp_s):
                due.append((request, sensor))
            else:
                settle(request.sensor_id)
                sensor.observe(state, request)
        return due

    def miss(
        self,
        state: WorldState,
        requests: Sequence[SensorRequest],
        settle: Callable[[int], None] = lambda sensor_id: None,
    ) -> None:
        """Let those that are known see a tick in which none has its turn."""
        if state.frame <= self._last_frame:
            return
        self._last_frame = state.frame
        for request in requests:
            sensor = self._sensors.get(request.sensor_id)
            if sensor is not None and sensor.answers(request):
                settle(request.sensor_id)
                sensor.observe(state, request)

    def _made(self, request: SensorRequest) -> Sensor:
        sensor = SensorRegistry.make(request, self._town)
        if self._loop is None:
            return sensor
        return LoopingSensor(sensor, request, self._town, self._loop)
