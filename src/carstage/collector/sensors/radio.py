"""V2X radios: records of the awareness messages of a tick, often of none."""

from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping, Optional, Tuple

from carstage.collector.sensors.base import Attributes, Sensor
from carstage.rawlog.format import Buffer

_MOST_SENDERS = 64
_STATION_TYPES = {
    "Unknown": 0,
    "Pedestrian": 1,
    "Cyclist": 2,
    "Moped": 3,
    "Motorcycle": 4,
    "Passenger Car": 5,
    "Bus": 6,
    "Light Truck": 7,
    "HeavyTruck": 8,
    "Trailer": 9,
    "Special Vehicle": 10,
    "Tram": 11,
    "Road Side Unit": 15,
}
"""Words of the client (``SensorData.cpp``) to numbers of ETSI TS 102 894-2."""

_SPEED_UNAVAILABLE, _HEADING_UNAVAILABLE = 16383, 3601
_YAW_RATE_UNAVAILABLE, _ACCELERATION_UNAVAILABLE = 32767, 161
_LENGTH_UNAVAILABLE, _WIDTH_UNAVAILABLE = 1023, 62
"""Numbers by which ETSI TS 102 894-2 says that a value is not known."""

_MOTION_VALUES = 9


class V2x(Sensor):
    """Awareness messages: numbers of the table's columns, NaN for what a message does not say."""

    def expected_bytes(self, attributes: Attributes, fps: float) -> int:
        """Messages of as many senders as a street has."""
        return _MOST_SENDERS * self.datum_bytes

    def size_bytes(self, data: Any) -> int:
        """Messages by the bytes of one."""
        return int(data.get_message_count()) * self.datum_bytes

    def encode(self, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """No meta; the messages one after the other."""
        rows = [_numbers(message) for message in data]
        return {}, b"".join(self.kind.layout.pack(*row) for row in sorted(rows))


def _numbers(message: Any) -> List[float]:
    """A message in the order of the table's columns; the client keeps the altitude to itself."""
    told = message.get()["Message"]
    parameters = told["Message"]["CAM Parameters"]
    basic = parameters["Basic Container"]
    place = basic["Reference Position"]
    fast = parameters["High Frequency Container"]
    return [
        told["Header"]["Station ID"],
        _STATION_TYPES.get(basic["Station Type"], 0),
        told["Message"]["Generation Delta Time"],
        place["Latitude"] * 1e-7,
        place["Longitude"] * 1e-7,
        *_motion(fast.get("Basic Vehicle Container High Frequency")),
        message.power,
    ]


def _motion(container: Optional[Mapping[str, Any]]) -> List[float]:
    """Heading to yaw rate, with the signs of CARLA; NaN of a station that is no vehicle."""
    if container is None:
        return [math.nan] * _MOTION_VALUES
    return [
        _known(container["Heading"], 0.1, _HEADING_UNAVAILABLE),
        _known(container["Speed"], 0.01, _SPEED_UNAVAILABLE),
        container["Drive Direction"],
        _known(container["Vehicle Length"], 0.1, _LENGTH_UNAVAILABLE),
        _known({"Value": container["Vehicle Width"]}, 0.1, _WIDTH_UNAVAILABLE),
        _known(container["Longitudinal Acceleration"], 0.1, _ACCELERATION_UNAVAILABLE),
        _known(container["Lateral Acceleration"], 0.1, _ACCELERATION_UNAVAILABLE),
        _known(container["Vertical Acceleration"], 0.1, _ACCELERATION_UNAVAILABLE),
        _known(container["Yaw Rate"], 0.01, _YAW_RATE_UNAVAILABLE),
    ]


def _known(entry: Optional[Mapping[str, Any]], unit: float, unavailable: int) -> float:
    """A value in whole units; NaN where the message does not say it."""
    if entry is None or entry["Value"] == unavailable:
        return math.nan
    return float(entry["Value"]) * unit
