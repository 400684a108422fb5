"""What V2X stations send: cooperative awareness messages by ETSI's rule, and clients' own texts.

A station is what carries a V2X sensor; a sensor that nothing carries is a roadside unit itself. Who
receives a message is found where radio waves are, in :mod:`carstage_sim.sensors.v2x`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.world.actors import Actor, ActorTable
from carstage_sim.world.pose import Pose, Vector3
from carstage_sim.world.state import ActorKind
from carstage_sim.world.transmissions import (
    CAM_SENSOR,
    CUSTOM_SENSOR,
    StationType,
    Transmission,
)

_ROADSIDE_INTERVAL_S = 0.5
_LOW_FREQUENCY_INTERVAL_S = 0.5
_LOW_DYNAMICS_LIMIT = 3
_TOLERANCE_S = 1e-6
"""Simulated time is a sum of steps."""


_BY_LABEL: Mapping[int, StationType] = {
    CityObjectLabel.BICYCLE: StationType.CYCLIST,
    CityObjectLabel.MOTORCYCLE: StationType.MOTORCYCLE,
    CityObjectLabel.CAR: StationType.PASSENGER_CAR,
    CityObjectLabel.BUS: StationType.BUS,
    CityObjectLabel.TRUCK: StationType.LIGHT_TRUCK,
    CityObjectLabel.TRAIN: StationType.TRAM,
}


class CamClock:
    """When a station sends its next cooperative awareness message.

    ETSI EN 302 637-2, 6.1.3: not before ``gen_cam_min``; then as soon as heading, position or speed
    differ by more than 4 degrees, 4 m or 0.5 m/s from the last message; at the latest after the
    current period. A change makes the time that passed the period, and after three messages
    without one it is ``gen_cam_max`` again. Roadside units send twice a second (CARLA's
    ``CaService.cpp``).

    Args:
        attributes: of the sensor; ``fixed_rate`` makes it send whenever ``gen_cam_min`` has passed.
        station_type: what the station is.
    """

    def __init__(self, attributes: Mapping[str, str], station_type: StationType) -> None:
        self._shortest_s = float(attributes["gen_cam_min"])
        self._longest_s = float(attributes["gen_cam_max"])
        self._fixed_rate = attributes["fixed_rate"].lower() == "true"
        if station_type is StationType.ROADSIDE_UNIT:
            self._shortest_s, self._fixed_rate = _ROADSIDE_INTERVAL_S, True
        self._period_s = self._longest_s
        self._unchanged = 0
        self._sent_s = -math.inf
        self._low_frequency_s = -math.inf
        self._sent: tuple[Vector3, Vector3, float] | None = None

    def is_due(self, now_s: float, pose: Pose, speed: float) -> bool:
        """Whether the station sends now; counts the message.

        Args:
            now_s: simulated seconds.
            pose: of the station.
            speed: m/s forwards.
        """
        passed_s = now_s - self._sent_s + _TOLERANCE_S
        if passed_s < self._shortest_s:
            return False
        ahead = _ahead(pose)
        if not self._fixed_rate and self._sent is not None:
            if self._has_changed(pose.location, ahead, speed):
                self._period_s = min(passed_s - _TOLERANCE_S, self._longest_s)
                self._unchanged = 0
            elif passed_s < self._period_s:
                return False
            else:
                self._unchanged += 1
                if self._unchanged >= _LOW_DYNAMICS_LIMIT:
                    self._period_s = self._longest_s
        self._sent_s = now_s
        self._sent = (pose.location, ahead, speed)
        return True

    def takes_low_frequency(self, now_s: float) -> bool:
        """Whether a message of now has what seldom changes, twice a second; counts it."""
        if now_s - self._low_frequency_s + _TOLERANCE_S < _LOW_FREQUENCY_INTERVAL_S:
            return False
        self._low_frequency_s = now_s
        return True

    def _has_changed(self, location: Vector3, ahead: Vector3, speed: float) -> bool:
        if self._sent is None:
            return True
        place, direction, pace = self._sent
        along = sum(a * b for a, b in zip(ahead, direction, strict=True))
        return (
            math.degrees(math.acos(min(max(along, -1.0), 1.0))) > 4.0
            or math.dist(location, place) > 4.0
            or abs(speed - pace) > 0.5
        )


class V2xStations:
    """The V2X sensors of a world as senders.

    Attributes:
        transmissions: what was sent in the last tick, by ascending sensor ids.
    """

    def __init__(self) -> None:
        self.transmissions: tuple[Transmission, ...] = ()
        self._clocks: dict[int, CamClock] = {}
        self._texts: dict[int, str] = {}

    def send(self, sensor_id: int, text: str) -> None:
        """Let a sensor send a text in the next tick; of several the last, as in CARLA 0.9.16."""
        self._texts[sensor_id] = text

    def step(self, actors: ActorTable, frame: int, now_s: float) -> None:
        """Find what is sent in a tick, after everybody moved.

        A station has one message: of several sensors on it the last one's, as in CARLA.
        """
        sensors = [
            actor
            for actor in actors.of_kind(ActorKind.SENSOR)
            if actor.type_id in (CAM_SENSOR, CUSTOM_SENSOR)
        ]
        if not sensors and not self.transmissions:
            self._texts.clear()
            return
        sent: dict[tuple[str, int], Transmission] = {}
        clocks: dict[int, CamClock] = {}
        for sensor in sensors:
            station = actors.get(sensor.parent_id) or sensor
            station_type = _station_type(station)
            key = (sensor.type_id, station.actor_id)
            if sensor.type_id == CUSTOM_SENSOR:
                text = self._texts.get(sensor.actor_id)
                if text is not None:
                    sent[key] = _transmission(actors, sensor, station, frame, now_s, text=text)
                continue
            clock = self._clocks.get(sensor.actor_id)
            clock = clock or CamClock(sensor.attributes, station_type)
            clocks[sensor.actor_id] = clock
            pose = actors.pose(station.actor_id)
            if clock.is_due(now_s, pose, _speed(actors, station)):
                low = clock.takes_low_frequency(now_s)
                sent[key] = _transmission(actors, sensor, station, frame, now_s, low_frequency=low)
        self._clocks = clocks
        self._texts.clear()
        self.transmissions = tuple(sorted(sent.values(), key=lambda one: one.sensor_id))


def _ahead(pose: Pose) -> Vector3:
    x, y, z = rotation_matrix(pose.rotation_deg)[:, 0].tolist()
    return (x, y, z)


def _speed(actors: ActorTable, station: Actor) -> float:
    row = actors.row(station.actor_id)
    return float(actors.velocity[row] @ rotation_matrix(actors.rotation_deg[row])[:, 0])


def _transmission(
    actors: ActorTable,
    sensor: Actor,
    station: Actor,
    frame: int,
    now_s: float,
    *,
    low_frequency: bool = False,
    text: str | None = None,
) -> Transmission:
    row = actors.row(station.actor_id)
    pose = actors.pose(station.actor_id)
    vx, vy, vz = actors.velocity[row].tolist()
    ax, ay, az = actors.acceleration[row].tolist()
    wx, wy, wz = actors.angular_velocity_deg[row].tolist()
    return Transmission(
        sensor_id=sensor.actor_id,
        type_id=sensor.type_id,
        attributes=sensor.attributes,
        station_id=station.actor_id,
        station_type=_station_type(station),
        frame=frame,
        timestamp_s=now_s,
        location=pose.location,
        rotation_deg=pose.rotation_deg,
        antenna=actors.pose(sensor.actor_id).location,
        velocity=(vx, vy, vz),
        acceleration=(ax, ay, az),
        angular_velocity_deg=(wx, wy, wz),
        half_size=station.box_extent,
        light_state=station.vehicle.light_state if station.vehicle is not None else 0,
        low_frequency=low_frequency,
        text=text,
    )


def _station_type(station: Actor) -> StationType:
    if station.kind is ActorKind.WALKER:
        return StationType.PEDESTRIAN
    if station.kind is not ActorKind.VEHICLE:
        return StationType.ROADSIDE_UNIT
    if station.attributes.get("special_type") == "emergency":
        return StationType.SPECIAL_VEHICLE
    known = (_BY_LABEL[label] for label in station.semantic_tags if label in _BY_LABEL)
    return next(known, StationType.UNKNOWN)
