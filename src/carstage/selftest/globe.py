"""How the server's GNSS sensors count: by which projection, and which way latitudes grow."""

from __future__ import annotations

from itertools import product

import numpy as np

from carstage.geometry import GeoFrame, GeoPoint
from carstage.releases import NORTHS, PROJECTIONS, GnssConvention, gnss_convention
from carstage.selftest.evidence import GNSS, Evidence
from carstage.selftest.verdict import Check

AGREES_M = 0.05
"""Snapshots have poses in float32: that is 1 cm at 100 km."""
ALIKE_M = 0.001
"""So near to the origin of the map that conventions cannot be told apart."""
_WORDS = {
    "spherical_mercator": "Mercator on a sphere",
    "transverse_mercator": "transverse Mercator on a sphere, scale 0.9996",
}


def check_gnss(evidence: Evidence) -> tuple[Check, GnssConvention | None]:
    """Which of the known conventions turns readings into the places where the sensor was.

    Labels follow what is found, so any known one is right. Near a map's origin several may fit;
    then the one of the server's release is taken.

    Returns:
        The check, and the convention; None where no known one fits.
    """
    usual = gnss_convention(str(evidence.header["server_version"]))
    errors_m = {
        GnssConvention(*pair): _error_m(evidence, GnssConvention(*pair))
        for pair in product(PROJECTIONS, NORTHS)
    }
    best = min(errors_m, key=lambda convention: errors_m[convention])
    if errors_m[usual] <= errors_m[best] + ALIKE_M:
        best = usual
    if errors_m[best] > AGREES_M:
        return Check("GNSS", False, "no known projection", _words(usual), errors_m[best], "m"), None
    return Check("GNSS", True, _words(best), _words(usual), errors_m[best], "m"), best


def _error_m(evidence: Evidence, convention: GnssConvention) -> float:
    """The largest distance of a reading from its sensor, m."""
    assert evidence.world_from_gnss is not None
    reference = {
        **evidence.header["geo_reference"],
        "projection": convention.projection,
        "gnss_north": convention.north,
    }
    frame = GeoFrame.from_json(reference)
    distances = [
        np.linalg.norm(frame.gnss_location(GeoPoint(*reading)) - pose[:3, 3])
        for reading, pose in zip(_readings(evidence), evidence.world_from_gnss, strict=True)
    ]
    return float(max(distances))


def _readings(evidence: Evidence) -> list[tuple[float, float, float]]:
    """Latitude, longitude (deg) and altitude (m) at each tick."""
    found = [np.frombuffer(record.payload, "<f8") for record in evidence.records[GNSS]]
    return [(float(values[0]), float(values[1]), float(values[2])) for values in found]


def _words(convention: GnssConvention) -> str:
    return f"{_WORDS[convention.projection]}, north at {convention.north}"
