"""What GNSS, compass and accelerometer must read at a pose: CARLA's earth model.

Sources: CARLA's ``GeoLocation.cpp``, ``InertialMeasurementUnit.cpp`` (releases up to 0.9.16).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from carstage.geometry.coordinates import FloatArray, rotate, rotation_matrix

EARTH_RADIUS_M = 6378137.0
GRAVITY_M_S2 = 9.81


@dataclass(frozen=True, slots=True)
class GeoPoint:
    """A position on the earth: degrees, degrees, metres."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float = 0.0


def geo_point(reference: GeoPoint, location_m: ArrayLike) -> GeoPoint:
    """Position of a world location: spherical Mercator about the map's reference.

    CARLA projects so whatever the map's PROJ string says. East is +x, north is -y.

    Args:
        reference: of the map's origin.
        location_m: ``(3,)`` world.
    """
    x, y, z = (float(value) for value in np.asarray(location_m, dtype=np.float64))
    scale = math.cos(math.radians(reference.latitude_deg))
    unit = scale * EARTH_RADIUS_M
    mx = unit * math.radians(reference.longitude_deg) + x
    my = unit * math.log(math.tan((90.0 + reference.latitude_deg) * math.pi / 360.0)) - y
    return GeoPoint(
        latitude_deg=360.0 / math.pi * math.atan(math.exp(my / unit)) - 90.0,
        longitude_deg=mx * 180.0 / (math.pi * unit),
        altitude_m=reference.altitude_m + z,
    )


def compass_rad(yaw_deg: float) -> float:
    """Compass heading in [0, 2 pi): north (-y) is 0, east (+x) is pi/2."""
    return math.radians((yaw_deg + 90.0) % 360.0)


def specific_force(
    rotation_deg: ArrayLike, acceleration: ArrayLike, gravity_m_s2: float = GRAVITY_M_S2
) -> FloatArray:
    """What an ideal accelerometer reads (m/s², sensor axes): (0, 0, g) at rest on the level.

    Args:
        rotation_deg: ``(3,)`` pitch, yaw, roll of the sensor, world.
        acceleration: ``(3,)`` of the sensor, world (m/s²).
        gravity_m_s2: the server's gravity.
    """
    total = np.asarray(acceleration, dtype=np.float64) + np.array([0.0, 0.0, gravity_m_s2])
    return rotate(rotation_matrix(rotation_deg).T, total)
