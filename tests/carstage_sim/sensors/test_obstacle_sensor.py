"""The obstacle detector: how far its ball goes, what counts, what does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material
from carstage_sim.sensors import SensorAttributeError, WorldSensors
from carstage_sim.sensors.measurements import ObstacleFrame
from carstage_sim.sensors.obstacle import ball_rays, feelers
from sensor_worlds import GROUND, WALL, box, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

POLE = box((4.0, 0.3, 10.0), (4.2, 0.5, 20.0), Material.METAL, CityObjectLabel.POLES)


@pytest.fixture(scope="module")
def sensors(tmp_path_factory):
    with WorldSensors(
        town(GROUND, WALL, POLE), threads=1, cache=tmp_path_factory.mktemp("trees")
    ) as built:
        yield built


def detected(sensors, world=None, **options):
    sensors.reset()
    options = {"location": (0.0, 0.0, 5.0), "distance": 30.0} | options
    return [frame for _, frame in sensors.capture(world or state(1), [
        request("other.obstacle", **options)])]  # fmt: skip


def test_a_ball_stops_its_radius_before_a_wall(sensors):
    for radius in (0.0, 0.5, 2.0):
        (found,) = detected(sensors, hit_radius=radius)
        assert found == ObstacleFrame(100, 0, CityObjectLabel.BUILDINGS, found.distance_m)
        assert found.distance_m == pytest.approx(10.0 - radius, abs=1e-4)


def test_the_way_of_the_ball_counts_not_that_of_its_front(sensors):
    assert detected(sensors, distance=9.4) == []
    assert len(detected(sensors, distance=9.6)) == 1


def test_what_is_beside_the_axis_is_met_later(sensors):
    # The pole's nearest edge is 4 m ahead and 0.3 m beside: 4 - sqrt(0.5^2 - 0.3^2).
    (found,) = detected(sensors, location=(0.0, 0.0, 15.0), hit_radius=0.5)
    assert found.label == CityObjectLabel.POLES
    assert found.distance_m == pytest.approx(4.0 - 0.4, abs=0.05)
    (thin,) = detected(sensors, location=(0.0, 0.0, 15.0), hit_radius=0.2)
    assert thin.label == CityObjectLabel.BUILDINGS


def test_what_the_ball_holds_already_is_no_way_off(sensors):
    (found,) = detected(sensors, location=(0.0, 0.0, 0.3), hit_radius=0.5)
    assert found == ObstacleFrame(100, 0, CityObjectLabel.ROADS, 0.0)


def test_an_actor_is_named_and_its_carrier_is_not_in_the_way(sensors):
    world = state(1, vehicles=[(3, (6.0, 0.0, 0.0), 90.0), (4, (0.0, 0.0, 0.0), 0.0)])
    (found,) = detected(sensors, world, location=(0.0, 0.0, 0.9), hit_radius=0.3, owner_id=4)
    assert found == ObstacleFrame(100, 3, 0, found.distance_m)
    assert 4.0 < found.distance_m < 5.5
    (foreign,) = detected(sensors, world, location=(0.0, 0.0, 0.9), hit_radius=0.3)
    assert foreign.other_id == 4


def test_only_dynamics_looks_through_the_town(sensors):
    world = state(1, vehicles=[(3, (16.0, 0.0, 0.0), 90.0)])
    low = {"location": (0.0, 0.0, 0.9), "hit_radius": 0.3}
    (found,) = detected(sensors, world, **low)
    assert found.other_id == 0
    (behind,) = detected(sensors, world, only_dynamics="True", **low)
    assert behind.other_id == 3
    assert detected(sensors, only_dynamics="true", **low) == []


def test_the_ball_follows_the_sensors_axis(sensors):
    assert detected(sensors, rotation_deg=(0.0, 180.0, 0.0)) == []
    (found,) = detected(sensors, rotation_deg=(-90.0, 0.0, 0.0), hit_radius=1.0)
    assert found.label == CityObjectLabel.ROADS
    assert found.distance_m == pytest.approx(4.0, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "value"), [("distance", -1), ("hit_radius", -1), ("only_dynamics", "perhaps")]
)
def test_an_impossible_detector_is_refused_by_the_attributes_name(sensors, name, value):
    with pytest.raises(SensorAttributeError, match=name):
        detected(sensors, **{name: value})


def test_the_rays_of_a_ball_cover_it():
    np.testing.assert_allclose(np.linalg.norm(feelers(), axis=1), 1.0)
    assert np.abs(feelers().mean(axis=0)).max() < 0.02
    across, half = ball_rays(2.0)
    assert len(across) == 91
    np.testing.assert_allclose(np.hypot(across[:, 0], across[:, 1]) ** 2 + half**2, 4.0, atol=1e-9)


@pytest.mark.parametrize("options", [{}, {"only_dynamics": "true"}])
def test_what_it_ignores_stays_ignored_beside_its_carrier(sensors, options):
    world = state(1, vehicles=[(3, (6.0, 0.0, 0.0), 90.0), (4, (0.0, 0.0, 0.0), 0.0)])
    asked = request(
        "other.obstacle", location=(0.0, 0.0, 0.9), distance=7.0, hit_radius=0.3, owner_id=4,
        **options,
    )  # fmt: skip
    for ignored, found in ((set(), [3]), ({3}, [])):
        sensors.reset()
        frames = sensors.capture(world, [replace(asked, ignored=frozenset(ignored))])
        assert [frame.other_id for _, frame in frames] == found
