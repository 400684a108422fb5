"""Golden tests D7 and D8: GNSS, compass, accelerometer."""

from __future__ import annotations

import numpy as np
import pytest

from carstage.geometry import GeoFrame, GeoPoint, compass_rad, specific_force
from carstage.releases import NORTHS, PROJECTIONS, North, Projection


def test_a_location_near_the_equator_has_the_golden_position() -> None:
    place = GeoFrame(GeoPoint(0.0, 0.0)).place([100.0, -100.0, 2.0])
    assert place.latitude_deg == pytest.approx(0.000898315284, abs=1e-11)
    assert place.longitude_deg == pytest.approx(0.000898315284, abs=1e-11)
    assert place.altitude_m == 2.0


def test_a_location_in_germany_has_the_golden_position() -> None:
    place = GeoFrame(GeoPoint(49.0, 8.0, 110.0)).place([100.0, -100.0, 2.0])
    assert place.latitude_deg == pytest.approx(49.000898307183, abs=1e-10)
    assert place.longitude_deg == pytest.approx(8.001369259845, abs=1e-10)
    assert place.altitude_m == 112.0


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("north", NORTHS)
@pytest.mark.parametrize("location", [(3200.0, -1700.0, 12.0), (-900.0, 4100.0, -3.0)])
def test_what_a_sensor_reads_leads_back_to_where_it_is(
    projection: Projection, north: North, location: tuple[float, float, float]
) -> None:
    frame = GeoFrame(GeoPoint(49.0, 8.0, 110.0), projection, north)
    np.testing.assert_allclose(frame.location(frame.place(location)), location, atol=1e-6)
    read = frame.gnss_place(location)
    np.testing.assert_allclose(frame.gnss_location(read), location, atol=1e-6)
    x, y, z = location
    # Whatever the sensor reads: north of a dataset is -y.
    assert (frame.place(location).latitude_deg > 49.0) is (y < 0.0)
    assert (read.latitude_deg > 49.0) is ((y > 0.0) if north == "+y" else (y < 0.0))
    assert (read.longitude_deg > 8.0) is (x > 0.0)
    assert read.altitude_m == 110.0 + z


def test_a_geo_reference_of_before_projections_were_named_is_mercator() -> None:
    old = {"latitude_deg": 49.0, "longitude_deg": 8.0, "altitude_m": 0.0}
    assert GeoFrame.from_json(old) == GeoFrame(GeoPoint(49.0, 8.0))
    with pytest.raises(ValueError, match="'flat' with north at '-y' is not known"):
        GeoFrame.from_json({**old, "projection": "flat"})


@pytest.mark.parametrize(
    ("yaw_deg", "expected"), [(0, np.pi / 2), (90, np.pi), (180, 3 * np.pi / 2), (-90, 0)]
)
def test_compass_counts_from_north_to_the_east(yaw_deg: float, expected: float) -> None:
    assert compass_rad(yaw_deg) == pytest.approx(expected)


def test_an_accelerometer_at_rest_reads_gravity_upwards() -> None:
    np.testing.assert_allclose(specific_force([0, 77, 0], [0, 0, 0]), [0, 0, 9.81], atol=1e-12)
    nose_up = specific_force([90.0, 0.0, 0.0], [0, 0, 0])
    np.testing.assert_allclose(nose_up, [9.81, 0, 0], atol=1e-12)
