"""IMU and GNSS after CARLA's formulas, with the golden values of the ground-truth rules."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.navigation import compass_rad
from carstage_sim.sensors.projection import GeoProjection, geodetic
from sensor_worlds import GROUND, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")


@pytest.fixture
def sensors(tmp_path):
    with WorldSensors(town(GROUND, geo_reference=(49.0, 8.0)), threads=1, cache=tmp_path) as built:
        yield built


@pytest.mark.parametrize(
    ("yaw_deg", "heading"),
    [(0.0, math.pi / 2), (90.0, math.pi), (180.0, 3 * math.pi / 2), (-90.0, 0.0)],
)
def test_compass_is_zero_to_the_north(yaw_deg, heading):
    # D8.
    assert compass_rad(yaw_deg) == pytest.approx(heading)


def read(sensors, sensor, frames=range(1, 5), **world):
    frame = None
    for number in frames:
        ((_, frame),) = sensors.capture(state(number, **world), [sensor(number)])
    return frame


def test_an_imu_at_rest_reads_gravity(sensors):
    frame = read(sensors, lambda k: request("other.imu"))
    assert frame.accelerometer == pytest.approx((0.0, 0.0, 9.81))
    assert frame.gyroscope == (0.0, 0.0, 0.0)


def test_an_imu_measures_the_second_difference_of_its_place(sensors):
    # x = 1.5 t^2 along the sensor's left: yaw 90 makes world +x its left.
    def at(k):
        return request(
            "other.imu", location=(1.5 * (0.1 * k) ** 2, 0.0, 1.0), rotation_deg=(0.0, 90.0, 0.0)
        )

    first = read(sensors, at, frames=[1])
    assert first.accelerometer == pytest.approx((0.0, 0.0, 9.81))
    frame = read(sensors, at, frames=[2, 3, 4])
    assert frame.accelerometer == pytest.approx((0.0, -3.0, 9.81), abs=1e-9)


def test_a_tilted_imu_feels_gravity_in_its_own_axes(sensors):
    frame = read(sensors, lambda k: request("other.imu", rotation_deg=(90.0, 0.0, 0.0)))
    assert frame.accelerometer == pytest.approx((9.81, 0.0, 0.0), abs=1e-9)


def test_the_gyroscope_reads_the_carriers_turn(sensors):
    # D10: degrees per second in the state, radians in the record; clockwise is positive.
    frame = read(
        sensors,
        lambda k: request("other.imu", owner_id=3, rotation_deg=(0.0, 30.0, 0.0)),
        vehicles=[(3, (0.0, 0.0, 0.0), 30.0)],
        angular_velocity_deg=(0.0, 0.0, 57.29578),
    )
    assert frame.gyroscope == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)


def test_bias_and_noise_come_from_the_attributes(sensors):
    biased = read(sensors, lambda k: request("other.imu", noise_gyro_bias_y=0.25))
    assert biased.gyroscope == pytest.approx((0.0, 0.25, 0.0))
    noisy = [
        sensors.capture(state(k), [request("other.imu", noise_seed=3, noise_accel_stddev_x=0.5)])[
            0
        ][1].accelerometer
        for k in range(10, 210)
    ]
    x = np.array(noisy)[:, 0]
    assert 0.4 < x.std() < 0.6
    assert np.array(noisy)[:, 1].std() == 0.0
    place = read(sensors, lambda k: request("other.gnss", noise_alt_bias=1.5))
    assert place.altitude_m == pytest.approx(3.5)


def test_gnss_reads_the_sensors_own_place(sensors):
    place = (100.0, -100.0, 2.0)
    frame = read(sensors, lambda k: request("other.gnss", location=place))
    latitude, longitude, altitude = geodetic(place, (49.0, 8.0), GeoProjection.TRANSVERSE_MERCATOR)
    assert (frame.latitude_deg, frame.longitude_deg) == (latitude, longitude)
    assert frame.altitude_m == altitude == 2.0
