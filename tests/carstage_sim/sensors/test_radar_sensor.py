"""CARLA's radar: order and sign of a detection, shape of the cone, its own velocity."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carstage_sim.sensors import SensorAttributeError, WorldSensors
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

MANY = {"points_per_second": 20_000, "horizontal_fov": 40.0, "vertical_fov": 20.0}


@pytest.fixture
def sensors(tmp_path_factory):
    with WorldSensors(
        town(GROUND, WALL), threads=1, cache=tmp_path_factory.getbasetemp() / "trees"
    ) as built:
        yield built


def detections(sensors, world, location=(0.0, 0.0, 30.0), **options):
    ((_, frame),) = sensors.capture(world, [request("other.radar", location=location, **options)])
    return frame.detections


def places(rows):
    """Ground truth section 13: sensor coordinates of detections."""
    _, azimuth, altitude, depth = rows.astype(float).T
    return np.stack(
        [
            depth * np.cos(altitude) * np.cos(azimuth),
            depth * np.cos(altitude) * np.sin(azimuth),
            depth * np.sin(altitude),
        ],
        axis=-1,
    )


def test_a_row_decodes_to_its_place():
    # D6.
    (place,) = places(np.array([[-5.0, 0.1, 0.05, 30.0]]))
    np.testing.assert_allclose(place, (29.812820, 2.991260, 1.499375), atol=1e-6)


def test_detections_lie_on_the_wall_and_within_the_cone(sensors):
    found = detections(sensors, state(1), **MANY)
    assert len(found) == 2000  # int(points per second * step), and all of them meet the wall
    place = places(found)
    np.testing.assert_allclose(place[:, 0], 10.0, atol=1e-4)
    across, up = math.tan(math.radians(20.0)), math.tan(math.radians(10.0))
    ellipse = (place[:, 1] / 10 / across) ** 2 + (place[:, 2] / 10 / up) ** 2
    assert ellipse.max() <= 1.0 + 1e-5
    assert np.median(np.sqrt(ellipse)) == pytest.approx(0.5, abs=0.05)  # even in radius


def test_azimuth_is_positive_to_the_right_and_altitude_upwards(sensors):
    car = state(1, vehicles=[(3, (9.0, 3.0, 0.0), 90.0)])
    found = detections(sensors, car, location=(0.0, 0.0, 0.8), horizontal_fov=60.0,
                       points_per_second=20_000)  # fmt: skip
    near = found[(found[:, 3] < 9.5) & (np.abs(found[:, 2]) < 0.05)]
    assert len(near) > 50
    assert (near[:, 1] > 0).all()
    ground = detections(sensors, state(2), rotation_deg=(-30.0, 0.0, 0.0), location=(0, 0, 2.0))
    assert places(ground[ground[:, 2] < -0.1])[:, 2].max() < 0.0


def test_a_parked_car_that_one_drives_towards_has_a_negative_velocity(sensors):
    # L5: velocity is the rate of the range, positive when receding.
    world = {"vehicles": [(3, (9.0, 0.0, 0.0), 90.0)]}
    detections(sensors, state(1, **world), location=(-1.0, 0.0, 0.8))
    found = detections(sensors, state(2, **world), location=(0.0, 0.0, 0.8))
    straight = found[(np.abs(found[:, 1]) < 0.05) & (np.abs(found[:, 2]) < 0.05)]
    assert len(straight) > 3
    np.testing.assert_allclose(straight[:, 0], -10.0, rtol=0.01)


def test_a_car_that_drives_away_has_a_positive_velocity(sensors):
    world = state(1, vehicles=[(3, (9.0, 0.0, 0.0), 0.0)], velocity=(7.0, 0.0, 0.0))
    found = detections(sensors, world, location=(0.0, 0.0, 0.8))
    straight = found[(found[:, 3] < 9.5) & (np.abs(found[:, 1:3]) < 0.05).all(axis=1)]
    assert len(straight) > 3
    np.testing.assert_allclose(straight[:, 0], 7.0, rtol=0.01)


def test_a_skipped_tick_does_not_change_the_velocity(sensors):
    options = {"sensor_tick": 0.2, "points_per_second": 2000}
    for frame in range(1, 6):
        sensor = request("other.radar", location=(0.2 * frame, 0.0, 30.0), **options)
        reported = sensors.capture(state(frame), [sensor])
    (_, found) = reported[0]
    centre = found.detections[np.abs(found.detections[:, 1:3]).max(axis=1) < 0.02]
    np.testing.assert_allclose(centre[:, 0], -2.0, rtol=0.01)


def test_the_range_is_along_the_axis(sensors):
    wide = {"horizontal_fov": 100.0, "vertical_fov": 0.0, "points_per_second": 5000}
    assert len(detections(sensors, state(1), **wide, range=9.9)) == 0
    found = detections(sensors, state(2), **wide, range=10.1)
    assert len(found) == 500
    assert found[:, 3].max() > 12.0


def test_rays_follow_the_seed_and_differ_between_frames(sensors):
    first = detections(sensors, state(1), noise_seed=5)
    second = detections(sensors, state(2), noise_seed=5)
    assert not np.array_equal(first[:, 1], second[:, 1])
    sensors.reset()
    np.testing.assert_array_equal(detections(sensors, state(1), noise_seed=5), first)
    sensors.reset()
    assert not np.array_equal(detections(sensors, state(1), noise_seed=6), first)
    assert len(detections(sensors, state(2), noise_seed=-1)) == len(first)


@pytest.mark.parametrize(
    ("name", "value"), [("range", -1), ("horizontal_fov", 180), ("points_per_second", -1)]
)
def test_an_impossible_radar_is_refused_by_the_attributes_name(sensors, name, value):
    with pytest.raises(SensorAttributeError, match=name):
        detections(sensors, state(1), **{name: value})
