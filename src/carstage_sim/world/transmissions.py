"""A message of a V2X station, as it leaves the station."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from carstage_sim.world.pose import Vector3

CAM_SENSOR = "sensor.other.v2x"
CUSTOM_SENSOR = "sensor.other.v2x_custom"
LONGEST_TEXT = 99
"""Bytes of a client's own message: CARLA 0.9.16 has a field of 100, the last one a zero."""


class StationType(IntEnum):
    """ETSI TS 102 894-2, data element ``StationType``."""

    UNKNOWN = 0
    PEDESTRIAN = 1
    CYCLIST = 2
    MOTORCYCLE = 4
    PASSENGER_CAR = 5
    BUS = 6
    LIGHT_TRUCK = 7
    SPECIAL_VEHICLE = 10
    TRAM = 11
    ROADSIDE_UNIT = 15


@dataclass(frozen=True, slots=True)
class Transmission:
    """A message that a V2X sensor sends in a frame, with the motion of its station.

    Attributes:
        sensor_id: the sensor that sends.
        type_id: its blueprint id.
        attributes: its attributes: transmit power, noise.
        station_id: actor id of the station.
        station_type: what the station is.
        frame: when it is sent.
        timestamp_s: simulated seconds since the episode began.
        location, rotation_deg: the station's pose (m; pitch, yaw, roll in deg).
        antenna: where the sensor is, world metres.
        velocity, acceleration: m/s and m/s^2, world.
        angular_velocity_deg: deg/s, world.
        half_size: half sizes of the station's box, metres.
        light_state: ``carla.VehicleLightState`` bits of a vehicle.
        low_frequency: whether what seldom changes is part of the message.
        text: a client's own message; None for a cooperative awareness message.
    """

    sensor_id: int
    type_id: str
    attributes: Mapping[str, str]
    station_id: int
    station_type: StationType
    frame: int
    timestamp_s: float
    location: Vector3
    rotation_deg: Vector3
    antenna: Vector3
    velocity: Vector3
    acceleration: Vector3
    angular_velocity_deg: Vector3
    half_size: Vector3
    light_state: int
    low_frequency: bool
    text: str | None = None
