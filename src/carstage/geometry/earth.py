"""What GNSS, compass and accelerometer must read at a pose: CARLA's earth models.

Sources: CARLA's ``GeoLocation.cpp``, ``InertialMeasurementUnit.cpp`` (releases up to 0.9.16).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from carstage.geometry.coordinates import FloatArray, rotate, rotation_matrix
from carstage.releases import NORTHS, PROJECTIONS, North, Projection

EARTH_RADIUS_M = 6378137.0
GRAVITY_M_S2 = 9.81
_TRANSVERSE_SCALE = 0.9996
"""Along the central meridian, fixed in CARLA 0.9.16."""


@dataclass(frozen=True, slots=True)
class GeoPoint:
    """A position on the earth: degrees, degrees, metres."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float = 0.0


@dataclass(frozen=True, slots=True)
class GeoFrame:
    """How a map lies on the globe: CARLA's axes in metres, and degrees on a sphere.

    East is +x. Datasets have north at -y, as the map's OpenDRIVE file has. The GNSS sensors of
    some servers have it at +y: what they read is mirrored.

    Attributes:
        reference: position of the map's origin.
        projection: of the server.
        gnss_north: which way latitudes grow in readings of the server's GNSS sensors.
    """

    reference: GeoPoint
    projection: Projection = "spherical_mercator"
    gnss_north: North = "-y"

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> GeoFrame:
        """Read ``geo_reference``; older documents name no projection.

        Raises:
            KeyError, ValueError: it is none.
        """
        projection = document.get("projection", "spherical_mercator")
        north = document.get("gnss_north", "-y")
        if projection not in PROJECTIONS or north not in NORTHS:
            raise ValueError(f"geo_reference: {projection!r} with north at {north!r} is not known")
        return cls(
            GeoPoint(
                float(document["latitude_deg"]),
                float(document["longitude_deg"]),
                float(document.get("altitude_m", 0.0)),
            ),
            projection,
            north,
        )

    def place(self, location_m: ArrayLike) -> GeoPoint:
        """Position of a world location ``(3,)``; north is -y."""
        x, y, z = (float(value) for value in np.asarray(location_m, dtype=np.float64))
        return self._place(x, -y, z)

    def places(self, locations_m: ArrayLike) -> FloatArray:
        """Longitude, latitude (deg) and altitude (m) ``(N, 3)`` of world locations ``(N, 3)``.

        One by one as :meth:`place` does: NumPy's own functions round as its version likes.
        """
        world = np.asarray(locations_m, dtype=np.float64).reshape(-1, 3).tolist()
        found = [self._place(x, -y, z) for x, y, z in world]
        rows = [(place.longitude_deg, place.latitude_deg, place.altitude_m) for place in found]
        return np.array(rows, dtype=np.float64).reshape(-1, 3)

    def location(self, place: GeoPoint) -> FloatArray:
        """World location ``(3,)`` of a position, the inverse of ``place``."""
        forward = _mercator if self.projection == "spherical_mercator" else _transverse_mercator
        east, north = forward(place, self.reference)
        return np.array([east, -north, place.altitude_m - self.reference.altitude_m])

    def gnss_place(self, location_m: ArrayLike) -> GeoPoint:
        """What a GNSS sensor of the server reads at a world location ``(3,)``, without noise."""
        x, y, z = (float(value) for value in np.asarray(location_m, dtype=np.float64))
        return self._place(x, y if self.gnss_north == "+y" else -y, z)

    def gnss_location(self, reading: GeoPoint) -> FloatArray:
        """World location ``(3,)`` that a GNSS sensor read, the inverse of ``gnss_place``."""
        location = self.location(reading)
        if self.gnss_north == "+y":
            location[1] = -location[1]
        return location

    def _place(self, east: float, north: float, up: float) -> GeoPoint:
        inverse = (
            _mercator_inverse
            if self.projection == "spherical_mercator"
            else _transverse_mercator_inverse
        )
        latitude_deg, longitude_deg = inverse(east, north, self.reference)
        return GeoPoint(latitude_deg, longitude_deg, self.reference.altitude_m + up)


def _mercator_inverse(east: float, north: float, reference: GeoPoint) -> tuple[float, float]:
    """Latitude and longitude (deg) by CARLA's spherical Mercator."""
    unit = math.cos(math.radians(reference.latitude_deg)) * EARTH_RADIUS_M
    mx = unit * math.radians(reference.longitude_deg) + east
    my = unit * _isometric_latitude(reference.latitude_deg) + north
    latitude_deg = 360.0 / math.pi * math.atan(math.exp(my / unit)) - 90.0
    return latitude_deg, mx * 180.0 / (math.pi * unit)


def _mercator(place: GeoPoint, reference: GeoPoint) -> tuple[float, float]:
    """East and north (m) by CARLA's spherical Mercator."""
    unit = math.cos(math.radians(reference.latitude_deg)) * EARTH_RADIUS_M
    north = _isometric_latitude(place.latitude_deg) - _isometric_latitude(reference.latitude_deg)
    return unit * math.radians(place.longitude_deg - reference.longitude_deg), unit * north


def _isometric_latitude(latitude_deg: float) -> float:
    return math.log(math.tan((90.0 + latitude_deg) * math.pi / 360.0))


def _transverse_mercator_inverse(
    east: float, north: float, reference: GeoPoint
) -> tuple[float, float]:
    """Latitude and longitude (deg): Snyder, USGS Professional Paper 1395, equations 8-6 to 8-8."""
    along = east / (_TRANSVERSE_SCALE * EARTH_RADIUS_M)
    foot = north / (_TRANSVERSE_SCALE * EARTH_RADIUS_M) + math.radians(reference.latitude_deg)
    turned = math.atan2(math.sinh(along), math.cos(foot))
    latitude_deg = math.degrees(math.asin(math.sin(foot) / math.cosh(along)))
    return latitude_deg, reference.longitude_deg + math.degrees(turned)


def _transverse_mercator(place: GeoPoint, reference: GeoPoint) -> tuple[float, float]:
    """East and north (m): Snyder, equations 8-1 to 8-3 and 8-5."""
    scale = _TRANSVERSE_SCALE * EARTH_RADIUS_M
    latitude = math.radians(place.latitude_deg)
    turned = math.radians(place.longitude_deg - reference.longitude_deg)
    foot = math.atan2(math.tan(latitude), math.cos(turned))
    east = scale * math.atanh(math.cos(latitude) * math.sin(turned))
    return east, scale * (foot - math.radians(reference.latitude_deg))


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
