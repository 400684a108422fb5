"""Sensors that report what happens to their carrier instead of measuring in every tick."""

from __future__ import annotations

from collections.abc import Sequence

from carstage_sim.sensors.measurements import CollisionFrame, SensorFrame, SensorRequest
from carstage_sim.sensors.sensor import Sensor, SensorRegistry
from carstage_sim.sensors.view import View
from carstage_sim.world.state import WorldState


@SensorRegistry.register("sensor.other.collision")
class CollisionSensor(Sensor):
    """One event per tick for each thing that the carrier touches (``CollisionSensor.cpp``)."""

    looks = False

    def report(
        self, state: WorldState, request: SensorRequest, view: View
    ) -> Sequence[SensorFrame]:
        """The carrier's collisions, ascending ids of what it touched."""
        carrier = request.owner_id
        events = []
        for collision in state.collisions:
            x, y, z = collision.impulse
            if carrier and collision.first_id == carrier:
                other, impulse = collision.second_id, (-x, -y, -z)
            elif carrier and collision.second_id == carrier:
                other, impulse = collision.first_id, (x, y, z)
            else:
                continue
            events.append(CollisionFrame(carrier, other, collision.label, impulse))
        return sorted(events, key=lambda event: event.other_id)


@SensorRegistry.register("sensor.other.lane_invasion")
class LaneInvasionSensor(Sensor):
    """Nothing is sent: clients find crossed markings themselves, from snapshots and the map."""

    looks = False

    def report(
        self, state: WorldState, request: SensorRequest, view: View
    ) -> Sequence[SensorFrame]:
        """Nothing."""
        return ()
