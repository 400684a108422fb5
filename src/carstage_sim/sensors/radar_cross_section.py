"""Radar cross sections (RCS) of what a radar's rays meet, dBsm.

- Vehicles: the pattern that 3GPP TR 38.901 V19 (7.9.2.1, table 7.9.2.1-4) gives a passenger car
  with one scattering point, by the direction of the radar in the car's axes. The car is that of
  TR 37.885 (6.1.2, type 2). Others have as much more or less as their box shows more or less area.
- People: the mean of TR 38.901's human model 1. Two-wheelers with riders are taken for people.
- Everything else: the constant-gamma model of land clutter (D. K. Barton, *Land clutter models for
  radar design and analysis*, Proceedings of the IEEE 73(2), 1985). A surface has gamma times the
  sine of the grazing angle per area. The area that a ray stands for grows by the same sine, so
  what is left is gamma times the ray's solid angle and the range squared.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.labels import CityObjectLabel as Label

Vector = NDArray[np.float64]

CAR_M: Final = (5.0, 2.0, 1.6)
"""Length, width, height of the car whose pattern is known."""
NARROW_M: Final = 1.2
"""Vehicles that are less wide have two wheels."""
PERSON_DBSM: Final = -1.37
PERSON_DEVIATION_DB: Final = 3.94
VEHICLE_DEVIATION_DB: Final = 3.41
LEAST_DBSM: Final = -100.0
"""Of a ray that stands for no area."""


class _Side(NamedTuple):
    """A lobe: most (dBsm), what it falls by at most (dB), middle and widths at -3 dB (degrees)."""

    most_dbsm: float
    fall_db: float
    azimuth_deg: float
    azimuth_width_deg: float
    zenith_deg: float
    zenith_width_deg: float


_FRONT: Final = _Side(15.52, 8.45, 0.0, 40.54, 71.75, 29.13)
_FLANK: Final = _Side(20.75, 13.68, 90.0, 26.90, 79.70, 44.42)
_REAR: Final = _Side(14.56, 7.50, 180.0, 36.32, 79.65, 36.73)
_ROOF: Final = _Side(21.26, 14.19, 0.0, math.inf, 0.0, 18.13)
_ROOF_DEG: Final = 30.0
_GHZ: Final = 77.0
_AT_77_GHZ_DB: Final = 5.0 * math.log10(_GHZ / 10.0)
"""Gammas are known for 10 GHz, and grow by the root of the frequency."""
_FLAT_DB, _WOODS_DB, _TOWN_DB = -20.0, -15.0, 0.0
_GAMMA_DB: Final[Mapping[Label, float]] = {
    Label.ROADS: _FLAT_DB,
    Label.ROAD_LINES: _FLAT_DB,
    Label.SIDEWALKS: _FLAT_DB,
    Label.WATER: _FLAT_DB,
    Label.TERRAIN: _WOODS_DB,
    Label.GROUND: _WOODS_DB,
    Label.VEGETATION: _WOODS_DB,
}
"""Barton's flat land, farmland and woods; all that is built has that of a town."""


def car_dbsm(towards_radar: Vector) -> Vector:
    """RCS of the known car.

    Args:
        towards_radar: ``(N, 3)`` unit vectors from the car to the radar, in its axes (x ahead).

    Returns:
        ``(N,)`` mean RCS; left and right are alike.
    """
    x, y, z = towards_radar.T
    zenith_deg = np.degrees(np.arccos(np.clip(z, -1.0, 1.0)))
    azimuth_deg = np.abs(np.degrees(np.arctan2(y, x)))
    found = np.where(azimuth_deg <= 45.0, _lobe(_FRONT, azimuth_deg, zenith_deg), 0.0)
    found = np.where(azimuth_deg > 45.0, _lobe(_FLANK, azimuth_deg, zenith_deg), found)
    found = np.where(azimuth_deg > 135.0, _lobe(_REAR, azimuth_deg, zenith_deg), found)
    return np.where(zenith_deg < _ROOF_DEG, _lobe(_ROOF, azimuth_deg, zenith_deg), found)


def vehicle_dbsm(towards_radar: Vector, size_m: Vector) -> Vector:
    """Mean RCS of vehicles, by their boxes.

    Args:
        towards_radar: ``(N, 3)`` unit vectors from their middles to the radar, in their axes.
        size_m: ``(N, 3)`` length, width, height.
    """
    area = _shown_area(towards_radar, size_m) / _shown_area(towards_radar, np.array([CAR_M]))
    known = car_dbsm(towards_radar) + 10.0 * np.log10(np.maximum(area, 1e-9))
    return np.where(size_m[:, 1] < NARROW_M, PERSON_DBSM, known)


def clutter_dbsm(tags: NDArray[np.uint8], solid_angle_sr: Vector, range_m: Vector) -> Vector:
    """RCS of the surface that a ray stands for.

    Args:
        tags: ``(N,)`` semantic tags.
        solid_angle_sr: ``(N,)`` of each ray.
        range_m: ``(N,)`` where it ends.
    """
    gamma_db = np.full(256, _TOWN_DB + _AT_77_GHZ_DB)
    for tag, value_db in _GAMMA_DB.items():
        gamma_db[tag] = value_db + _AT_77_GHZ_DB
    area_m2 = solid_angle_sr * range_m**2
    least = 10.0 ** (LEAST_DBSM / 10.0)
    found = gamma_db[tags] + 10.0 * np.log10(np.maximum(area_m2, least))
    return np.asarray(np.maximum(found, LEAST_DBSM))


def fluctuation_db(normal: Vector, deviation_db: Vector) -> Vector:
    """Log-normal changes whose mean, as a factor, is 1 (TR 38.901, 7.9.2.1).

    Args:
        normal: ``(N,)`` standard normal numbers.
        deviation_db: ``(N,)``.
    """
    return np.asarray(deviation_db * normal - math.log(10.0) / 20.0 * deviation_db**2)


def _lobe(side: _Side, azimuth_deg: Vector, zenith_deg: Vector) -> Vector:
    across = 12.0 * ((azimuth_deg - side.azimuth_deg) / side.azimuth_width_deg) ** 2
    up = 12.0 * ((zenith_deg - side.zenith_deg) / side.zenith_width_deg) ** 2
    return np.asarray(side.most_dbsm - np.minimum(across + up, side.fall_db))


def _shown_area(towards: Vector, size_m: Vector) -> Vector:
    """``(N,)`` m^2 of the outline that boxes show to a direction."""
    length, width, height = size_m.T
    x, y, z = np.abs(towards).T
    return np.asarray(width * height * x + length * height * y + length * width * z)
