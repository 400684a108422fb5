"""Cooperative awareness messages as CARLA 0.9.16 lays them out, and what they say of a station.

The fields and their units are those of ETSI EN 302 637-2 and TS 102 894-2; the layout is that of
the client's ``CAMData`` and ``CustomV2XData`` (``LibITS.h``). Signs are CARLA's: lateral
acceleration and yaw rate are positive to the right, and the vertical acceleration holds gravity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.sensors.attributes import number, whole, within
from carstage_sim.sensors.navigation import GRAVITY_M_S2, compass_rad
from carstage_sim.sensors.projection import GeoProjection, geodetic
from carstage_sim.world.columns import Rotation
from carstage_sim.world.transmissions import StationType, Transmission

_LONG = "<i8"
_HEADER = np.dtype(
    [("protocol_version", _LONG), ("message_id", _LONG), ("station_id", _LONG)], align=True
)
_VALUE = np.dtype([("value", _LONG), ("confidence", _LONG)], align=True)
_TOLLING_ZONE = np.dtype(
    [("latitude", _LONG), ("longitude", _LONG), ("id", _LONG), ("has_id", "?")], align=True
)

CAM_DATA = np.dtype(
    [
        ("power", "<f4"),
        ("header", _HEADER),
        ("generation_delta_time", _LONG),
        ("station_type", _LONG),
        ("latitude", _LONG),
        ("longitude", _LONG),
        ("semi_major_confidence", _LONG),
        ("semi_minor_confidence", _LONG),
        ("semi_major_orientation", _LONG),
        ("altitude", _VALUE),
        ("high_frequency", _LONG),
        ("heading", _VALUE),
        ("speed", _VALUE),
        ("drive_direction", _LONG),
        ("vehicle_length", _VALUE),
        ("vehicle_width", _LONG),
        ("longitudinal_acceleration", _VALUE),
        ("curvature", _VALUE),
        ("curvature_calculation_mode", _LONG),
        ("yaw_rate", _VALUE),
        ("has_acceleration_control", "?"),
        ("acceleration_control", "u1"),
        ("has_lane_position", "?"),
        ("lane_position", _LONG),
        ("has_steering_wheel_angle", "?"),
        ("steering_wheel_angle", _VALUE),
        ("has_lateral_acceleration", "?"),
        ("lateral_acceleration", _VALUE),
        ("has_vertical_acceleration", "?"),
        ("vertical_acceleration", _VALUE),
        ("has_performance_class", "?"),
        ("performance_class", _LONG),
        ("has_tolling_zone", "?"),
        ("tolling_zone", _TOLLING_ZONE),
        ("protected_zone_count", _LONG),
        ("protected_zones", _LONG, (3,)),
        ("low_frequency", _LONG),
        ("vehicle_role", _LONG),
        ("exterior_lights", "u1"),
        ("path_point_count", _LONG),
        ("path_points", _LONG, (3,)),
    ],
    align=True,
)
"""One received message, 464 bytes: dBm, then the ``CAM_t`` of CARLA 0.9.16.

The two lists are empty C++ vectors, which are zeros.
"""

CUSTOM_DATA = np.dtype([("power", "<f4"), ("header", _HEADER), ("text", "S100")], align=True)
"""One received text, 136 bytes: dBm, header, text with a zero at its end."""

_PROTOCOL_VERSION = 2
_CAM, _CUSTOM = 2, 0
_NO_CONTAINER, _VEHICLE_CONTAINER, _ROADSIDE_CONTAINER = 0, 1, 2
_DELTA_TIME = 65_536
_PUBLIC_TRANSPORT, _EMERGENCY = 1, 6
_ROLES = {
    StationType.BUS: _PUBLIC_TRANSPORT,
    StationType.TRAM: _PUBLIC_TRANSPORT,
    StationType.SPECIAL_VEHICLE: _EMERGENCY,
}
_UNAVAILABLE = {
    "semi_major_confidence": 4095,
    "semi_minor_confidence": 4095,
    "semi_major_orientation": 3601,
}
_HEADING_WITHIN_A_DEGREE, _SPEED_CONFIDENCE = 10, 3
_LENGTH_CONFIDENCE_UNAVAILABLE, _ALTITUDE_CONFIDENCE_UNAVAILABLE = 4, 15
_ACCELERATION_UNAVAILABLE, _ACCELERATION_CONFIDENCE_UNAVAILABLE = 161, 102
_CURVATURE_UNAVAILABLE, _CURVATURE_CONFIDENCE_UNAVAILABLE = 30_001, 7
_YAW_RATE_UNAVAILABLE, _YAW_RATE_CONFIDENCE_UNAVAILABLE = 32_767, 8
_FASTEST_CM_S = 16_382

# ``carla.VehicleLightState`` bit -> bit of ETSI's ``ExteriorLights``, whose bit 0 is the highest.
_LIGHTS = {2: 0, 4: 1, 32: 2, 16: 3, 64: 5, 128: 6, 1: 7}

_NOISES = ("lat", "lon", "alt", "head")
_MOST_NOISE = 1e6
"""In the attribute's unit: what is off by more has no place in the whole numbers of a message."""


class CamNoise:
    """How far what a station says of itself is off, by its sensor's attributes.

    Args:
        attributes: of the sensor that sends.

    Raises:
        SensorAttributeError: one has an impossible value.
    """

    def __init__(self, attributes: Mapping[str, str]) -> None:
        self.seed = whole(attributes, "noise_seed", 0)
        names = (
            *(f"noise_{name}_stddev" for name in _NOISES),
            "noise_vel_stddev_x",
            *(f"noise_accel_stddev_{axis}" for axis in "xyz"),
            "noise_yawrate_stddev",
        )
        self._stddev = np.array([_noise(attributes, name, 0.0) for name in names])
        biases = (
            *(_noise(attributes, f"noise_{name}_bias", -_MOST_NOISE) for name in _NOISES),
            0.0,
            *(0.0 for _ in "xyz"),
            _noise(attributes, "noise_yawrate_bias", -_MOST_NOISE),
        )
        self._bias = np.array(biases)

    def draw(self, sensor_id: int, frame: int) -> NDArray[np.float64]:
        """``(9,)``: latitude, longitude, altitude, heading, speed, acceleration (3), yaw rate."""
        random = np.random.default_rng([self.seed & 0xFFFFFFFF or sensor_id, frame])
        drawn: NDArray[np.float64] = self._bias + random.normal(0.0, 1.0, 9) * self._stddev
        return drawn


def _noise(attributes: Mapping[str, str], name: str, lowest: float) -> float:
    value = number(attributes, name, 0.0)
    within(name, value, lowest, _MOST_NOISE)
    return value


def text_message(sent: Transmission, power_dbm: float) -> NDArray[np.void]:
    """``(1,)`` of :data:`CUSTOM_DATA`: a client's own message."""
    message = np.zeros(1, CUSTOM_DATA)
    message["power"] = power_dbm
    message["header"] = (_PROTOCOL_VERSION, _CUSTOM, sent.station_id)
    message["text"] = (sent.text or "").encode("utf-8", "surrogateescape")
    return message


def cam_message(
    sent: Transmission,
    power_dbm: float,
    reference_deg: tuple[float, float],
    projection: GeoProjection,
) -> NDArray[np.void]:
    """``(1,)`` of :data:`CAM_DATA`: what a station says of itself.

    Args:
        sent: the message.
        power_dbm: that it arrives with.
        reference_deg: latitude and longitude of the world's origin.
        projection: the protocol version's.
    """
    noise = CamNoise(sent.attributes).draw(sent.sensor_id, sent.frame)
    message = np.zeros(1, CAM_DATA)
    message["power"] = power_dbm
    message["header"] = (_PROTOCOL_VERSION, _CAM, sent.station_id)
    message["generation_delta_time"] = round(sent.timestamp_s * 1000.0) % _DELTA_TIME
    message["station_type"] = sent.station_type
    place = np.array(geodetic(sent.location, reference_deg, projection)) + noise[:3]
    latitude, longitude, altitude = place.tolist()
    # A tenth of a microdegree is the unit; CARLA rounds to whole microdegrees.
    message["latitude"] = round(latitude * 1e6) * 10
    message["longitude"] = round(longitude * 1e6) * 10
    message["altitude"] = (round(altitude * 100.0), _ALTITUDE_CONFIDENCE_UNAVAILABLE)
    for name, value in _UNAVAILABLE.items():
        message[name] = value
    if sent.station_type is StationType.ROADSIDE_UNIT:
        message["high_frequency"] = _ROADSIDE_CONTAINER
    elif sent.station_type is not StationType.PEDESTRIAN:
        _add_motion(message, sent, noise)
        if sent.low_frequency:
            message["low_frequency"] = _VEHICLE_CONTAINER
            message["vehicle_role"] = _ROLES.get(sent.station_type, 0)
            message["exterior_lights"] = sum(
                1 << (7 - bit) for state, bit in _LIGHTS.items() if sent.light_state & state
            )
    return message


def _add_motion(message: NDArray[np.void], sent: Transmission, noise: NDArray[np.float64]) -> None:
    rotation = rotation_matrix(sent.rotation_deg)
    message["high_frequency"] = _VEHICLE_CONTAINER
    heading_deg = math.degrees(compass_rad(sent.rotation_deg[Rotation.YAW])) + float(noise[3])
    message["heading"] = (round(heading_deg * 10.0) % 3600, _HEADING_WITHIN_A_DEGREE)
    forward = float(np.array(sent.velocity) @ rotation[:, 0])
    speed_cm_s = round(max(forward + float(noise[4]), 0.0) * 100.0)
    message["speed"] = (min(speed_cm_s, _FASTEST_CM_S), _SPEED_CONFIDENCE)
    message["drive_direction"] = 0 if forward >= 0.0 else 1
    length, width, _ = (round(half * 20.0) for half in sent.half_size)
    message["vehicle_length"] = (length, _LENGTH_CONFIDENCE_UNAVAILABLE)
    message["vehicle_width"] = width
    force = np.array(sent.acceleration) + np.array([0.0, 0.0, GRAVITY_M_S2])
    felt = force @ rotation + noise[5:8]
    ahead, right, up = (_tenths(value) for value in felt.tolist())
    for name, value in (
        ("longitudinal_acceleration", ahead),
        ("lateral_acceleration", right),
        ("vertical_acceleration", up),
    ):
        message[name] = (value, _ACCELERATION_CONFIDENCE_UNAVAILABLE)
    message["has_lateral_acceleration"] = message["has_vertical_acceleration"] = True
    message["curvature"] = (_CURVATURE_UNAVAILABLE, _CURVATURE_CONFIDENCE_UNAVAILABLE)
    turn_deg = np.array(sent.angular_velocity_deg) @ rotation
    yaw_rate = round((float(turn_deg[2]) + math.degrees(float(noise[8]))) * 100.0)
    known = abs(yaw_rate) < _YAW_RATE_UNAVAILABLE
    message["yaw_rate"] = (
        yaw_rate if known else _YAW_RATE_UNAVAILABLE,
        _YAW_RATE_CONFIDENCE_UNAVAILABLE,
    )


def _tenths(acceleration: float) -> int:
    """0.1 m/s^2 as ETSI counts, its word for unknown beyond 16 m/s^2."""
    tenths = round(acceleration * 10.0)
    return tenths if abs(tenths) <= 160 else _ACCELERATION_UNAVAILABLE
