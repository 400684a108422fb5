"""From the world to the globe, with the numbers of each version's own wheel."""

from __future__ import annotations

import pytest

from carstage_sim.sensors.projection import GeoProjection, geodetic
from carstage_sim.wire.dialect import DIALECTS

REFERENCE = (49.0, 8.0)
# carla.Map.transform_to_geolocation of the wheels, on a map with this reference.
WHEELS = {
    "0.9.15": {
        (0.0, 100.0, 0.0): (48.9991016766, 8.0, 0.0),
        (100.0, 0.0, 0.0): (49.0, 8.0013692598, 0.0),
        (50.0, 2000.0, 7.0): (48.9820304538, 8.0006846299, 7.0),
    },
    "0.9.16": {
        (0.0, 100.0, 0.0): (49.0008986748, 8.0, 0.0),
        (100.0, 0.0, 0.0): (48.9999999919, 8.0013698078, 0.0),
        (50.0, 2000.0, 7.0): (49.0179734931, 8.0006851512, 7.0),
    },
}


@pytest.mark.parametrize(
    ("version", "like"),
    [("0.9.13", "0.9.15"), ("0.9.14", "0.9.15"), ("0.9.15", "0.9.15"), ("0.9.16", "0.9.16")],
)
def test_a_place_is_where_the_versions_own_wheel_has_it(version, like):
    for location, expected in WHEELS[like].items():
        found = geodetic(location, REFERENCE, DIALECTS[version].projection)
        assert found == pytest.approx(expected, abs=1e-10)


def test_north_changed_sides_in_0_9_16():
    ahead = {p: geodetic((0.0, 1000.0, 0.0), REFERENCE, p)[0] - 49.0 for p in GeoProjection}
    assert ahead[GeoProjection.MERCATOR] < 0.0 < ahead[GeoProjection.TRANSVERSE_MERCATOR]


@pytest.mark.parametrize("projection", GeoProjection)
def test_the_origin_is_the_reference_and_east_is_always_x(projection):
    assert geodetic((0.0, 0.0, 3.0), REFERENCE, projection) == pytest.approx((*REFERENCE, 3.0))
    assert geodetic((1000.0, 0.0, 0.0), REFERENCE, projection)[1] > 8.0
