"""The radar with cross sections: its model by class and aspect, and how detections carry it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carstage_sim.labels import CityObjectLabel as Label
from carstage_sim.sensors import SensorAttributeError, WorldSensors
from carstage_sim.sensors.radar_cross_section import (
    LEAST_DBSM,
    PERSON_DBSM,
    VEHICLE_DEVIATION_DB,
    car_dbsm,
    clutter_dbsm,
    fluctuation_db,
    vehicle_dbsm,
)
from carstage_sim.sensors.rcs_radar import RcsRadar
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

MANY = {"points_per_second": 40_000, "horizontal_fov": 60.0, "vertical_fov": 30.0}
CAR_SIZE = np.array([[5.0, 2.0, 1.6]])


def towards(azimuth_deg, zenith_deg):
    """The unit vector to a radar, in the object's axes."""
    azimuth, zenith = np.radians(azimuth_deg), np.radians(zenith_deg)
    flat = np.sin(zenith)
    return np.atleast_2d(
        np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.cos(zenith)], axis=-1)
    )


@pytest.fixture
def sensors(tmp_path_factory):
    cache = tmp_path_factory.getbasetemp() / "trees"
    with WorldSensors(town(GROUND, WALL), threads=1, cache=cache) as built:
        yield built


def detections(sensors, world, kind="other.radar_rcs", **options):
    """``(N, 6)`` rows of a radar at 1 m that looks along x."""
    asked = request(kind, location=(0.0, 0.0, 1.0), **(MANY | options))
    ((_, frame),) = sensors.capture(world, [asked])
    if kind == "other.radar":
        return frame.detections
    assert frame.channel_counts.tolist() == [len(frame.points)]
    return frame.points.view(np.float32).reshape(-1, 6)


def test_the_pattern_has_the_peaks_widths_and_floor_of_the_table():
    # 3GPP TR 38.901 V19, table 7.9.2.1-4.
    for azimuth, zenith, most in ((0, 71.75, 15.52), (90, 79.7, 20.75), (180, 79.65, 14.56)):
        assert car_dbsm(towards(azimuth, zenith)) == pytest.approx(most, abs=1e-6)
    assert car_dbsm(towards(0, 0)) == pytest.approx(21.26, abs=1e-6)
    assert car_dbsm(towards(90 + 26.9 / 2, 79.7)) == pytest.approx(20.75 - 3.0, abs=1e-6)
    assert car_dbsm(towards(-90, 79.7)) == pytest.approx(20.75, abs=1e-6)
    assert car_dbsm(towards(45, 85)) == pytest.approx(7.07, abs=0.01)


def test_the_mean_over_all_aspects_is_that_of_the_table():
    # Even in the cosine of the zenith angle: even over the sphere.
    zenith = np.degrees(np.arccos((np.arange(400) + 0.5) / 200.0 - 1.0))
    azimuth = np.arange(360) + 0.5
    both = np.array(np.meshgrid(azimuth, zenith)).reshape(2, -1)
    mean = np.mean(10.0 ** (car_dbsm(towards(*both)) / 10.0))
    assert 10.0 * math.log10(mean) == pytest.approx(11.25, abs=0.01)


def test_larger_vehicles_have_more_by_the_area_that_they_show():
    side = towards(90, 90)
    assert vehicle_dbsm(side, CAR_SIZE) == pytest.approx(car_dbsm(side))
    lorry = vehicle_dbsm(side, np.array([[10.0, 2.5, 3.2]]))
    assert lorry - car_dbsm(side) == pytest.approx(10.0 * math.log10(4.0))
    assert vehicle_dbsm(side, np.array([[1.8, 0.7, 1.6]])) == pytest.approx(PERSON_DBSM)


def test_surfaces_have_gamma_times_solid_angle_times_range_squared():
    tags = np.array([Label.ROADS, Label.VEGETATION, Label.BUILDINGS, Label.ROADS], np.uint8)
    found = clutter_dbsm(tags, np.array([1e-2, 1e-2, 1e-2, 0.0]), np.full(4, 10.0))
    at_77_ghz = 5.0 * math.log10(7.7)
    assert found[:3] == pytest.approx(np.array([-20.0, -15.0, 0.0]) + at_77_ghz)
    assert found[3] == LEAST_DBSM


def test_solid_angles_add_up_to_the_cone(sensors):
    radar = RcsRadar(request("other.radar_rcs", **MANY), None)
    local = radar.rays(np.random.default_rng(1), 5.0)
    total = radar.solid_angles(local, len(local)).sum()
    across, up = math.tan(math.radians(30.0)), math.tan(math.radians(15.0))
    grid = (np.arange(400) + 0.5) / 200.0 - 1.0
    y, z = np.meshgrid(across * grid, up * grid)
    inside = (y / across) ** 2 + (z / up) ** 2 <= 1.0
    cone = ((1.0 + y**2 + z**2) ** -1.5)[inside].sum() * across * up / 200.0**2
    assert total == pytest.approx(cone, rel=0.02)


def test_fluctuation_keeps_the_mean():
    normal = np.random.default_rng(3).standard_normal(400_000)
    factor = 10.0 ** (fluctuation_db(normal, np.full(len(normal), VEHICLE_DEVIATION_DB)) / 10.0)
    assert factor.mean() == pytest.approx(1.0, abs=0.01)


def test_detections_are_those_of_the_radar_that_carla_has(sensors):
    world = state(1, vehicles=[(3, (6.0, 0.0, 0.0), 0.0)])
    plain = detections(sensors, world, "other.radar")
    np.testing.assert_array_equal(detections(sensors, world)[:, :4], plain)


def test_a_car_has_one_cross_section_by_its_aspect_and_surfaces_their_own(sensors):
    found = {}
    for yaw in (0.0, 90.0, 180.0):
        world = state(1, vehicles=[(3, (7.0, 0.0, 0.0), yaw)])
        rows = detections(sensors, world, fluctuation="false")
        of_car = rows[:, 5] == Label.CAR
        assert of_car.sum() > 50
        (found[yaw],) = np.unique(rows[of_car, 4])
        others = rows[~of_car]
        assert set(np.unique(others[:, 5])) <= {Label.ROADS, Label.BUILDINGS}
        assert len(np.unique(others[:, 4])) > 100
    # Its flank, its rear, its front, which looks up.
    assert found[90.0] > found[0.0] + 2.0 > found[180.0] + 2.0
    assert 10.0 < found[180.0] < found[0.0] < 15.0


def test_people_and_cars_fluctuate_from_tick_to_tick_as_one(sensors):
    values = []
    for frame in range(1, 60):
        world = state(frame, walkers=[(4, (5.0, 0.5, 1.0), 90.0)])
        rows = detections(sensors, world)
        (value,) = np.unique(rows[rows[:, 5] == Label.PEDESTRIANS, 4])
        values.append(value)
    assert np.std(values) == pytest.approx(3.94, rel=0.3)
    still = detections(sensors, world, fluctuation="false")
    of_person = still[:, 5] == Label.PEDESTRIANS
    assert still[of_person, 4] == pytest.approx(PERSON_DBSM)


def test_a_bad_word_for_fluctuation_is_refused(sensors):
    with pytest.raises(SensorAttributeError, match="fluctuation"):
        detections(sensors, state(1), fluctuation="perhaps")
