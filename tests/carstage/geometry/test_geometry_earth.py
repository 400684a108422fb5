"""Golden tests D7 and D8: GNSS, compass, accelerometer."""

from __future__ import annotations

import numpy as np
import pytest

from carstage.geometry import GeoPoint, compass_rad, geo_point, specific_force


def test_a_location_near_the_equator_has_the_golden_position() -> None:
    place = geo_point(GeoPoint(0.0, 0.0), [100.0, -100.0, 2.0])
    assert place.latitude_deg == pytest.approx(0.000898315284, abs=1e-11)
    assert place.longitude_deg == pytest.approx(0.000898315284, abs=1e-11)
    assert place.altitude_m == 2.0


def test_a_location_in_germany_has_the_golden_position() -> None:
    place = geo_point(GeoPoint(49.0, 8.0, 110.0), [100.0, -100.0, 2.0])
    assert place.latitude_deg == pytest.approx(49.000898307183, abs=1e-10)
    assert place.longitude_deg == pytest.approx(8.001369259845, abs=1e-10)
    assert place.altitude_m == 112.0


@pytest.mark.parametrize(
    ("yaw_deg", "expected"), [(0, np.pi / 2), (90, np.pi), (180, 3 * np.pi / 2), (-90, 0)]
)
def test_compass_counts_from_north_to_the_east(yaw_deg: float, expected: float) -> None:
    assert compass_rad(yaw_deg) == pytest.approx(expected)


def test_an_accelerometer_at_rest_reads_gravity_upwards() -> None:
    np.testing.assert_allclose(specific_force([0, 77, 0], [0, 0, 0]), [0, 0, 9.81], atol=1e-12)
    nose_up = specific_force([90.0, 0.0, 0.0], [0, 0, 0])
    np.testing.assert_allclose(nose_up, [9.81, 0, 0], atol=1e-12)
