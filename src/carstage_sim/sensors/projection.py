"""From places in the world to the globe, as each version of CARLA does it (``GeoLocation.cpp``).

Every version takes only latitude and longitude of the map's reference; none reads the rest of the
OpenDRIVE projection.
"""

from __future__ import annotations

import math
from enum import Enum

EARTH_RADIUS_M = 6_378_137.0
_SCALE = 0.9996
"""Scale along the central meridian, fixed in CARLA 0.9.16."""


class GeoProjection(Enum):
    """Which formula a version uses, and which way is north."""

    MERCATOR = "Mercator on a sphere; north is -y, as in the OpenDRIVE file"
    TRANSVERSE_MERCATOR = "transverse Mercator on a sphere, scale 0.9996; north is +y"


def geodetic(
    location: tuple[float, float, float],
    reference_deg: tuple[float, float],
    projection: GeoProjection,
) -> tuple[float, float, float]:
    """Latitude, longitude (deg) and altitude (m) of a world location.

    Args:
        location: world metres.
        reference_deg: latitude and longitude of the world's origin.
        projection: the version's.
    """
    x, y, z = location
    if projection is GeoProjection.MERCATOR:
        latitude, longitude = _mercator(x, -y, *reference_deg)
    else:
        latitude, longitude = _transverse_mercator(x, y, *reference_deg)
    return latitude, longitude, z


def _mercator(
    east: float, north: float, latitude_deg: float, longitude_deg: float
) -> tuple[float, float]:
    scale = math.cos(math.radians(latitude_deg))
    east += scale * EARTH_RADIUS_M * math.radians(longitude_deg)
    north += scale * EARTH_RADIUS_M * math.log(math.tan((90.0 + latitude_deg) * math.pi / 360.0))
    return (
        360.0 / math.pi * math.atan(math.exp(north / (EARTH_RADIUS_M * scale))) - 90.0,
        east * 180.0 / (math.pi * EARTH_RADIUS_M * scale),
    )


def _transverse_mercator(
    east: float, north: float, latitude_deg: float, longitude_deg: float
) -> tuple[float, float]:
    """Snyder, Map Projections (USGS Professional Paper 1395), equations 8-6 to 8-8."""
    along = east / (_SCALE * EARTH_RADIUS_M)
    foot = north / (_SCALE * EARTH_RADIUS_M) + math.radians(latitude_deg)
    return (
        math.degrees(math.asin(math.sin(foot) / math.cosh(along))),
        longitude_deg + math.degrees(math.atan2(math.sinh(along), math.cos(foot))),
    )
