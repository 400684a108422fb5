"""Rays of a flash LiDAR: where beams and their footprints look, and what rays say."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carstage_sim.labels import CityObjectLabel as Label
from carstage_sim.sensors import SensorAttributeError, WorldSensors
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

ARRAY = {
    "columns": 8, "rows": 4, "horizontal_fov": 40.0, "vertical_fov": 20.0, "range": 100.0,
    "horizontal_divergence": 5.0, "vertical_divergence": 5.0, "samples": 3,
}  # fmt: skip


@pytest.fixture
def sensors(tmp_path_factory):
    cache = tmp_path_factory.getbasetemp() / "trees"
    with WorldSensors(town(GROUND, WALL), threads=1, cache=cache) as built:
        yield built


def flash(sensors, world=None, **attributes):
    asked = request("lidar.ray_cast_flash", location=(0.0, 0.0, 30.0), **(ARRAY | attributes))
    ((_, frame),) = sensors.capture(world or state(1), [asked])
    assert frame.channel_counts.sum() == len(frame.points)
    return frame


def xyz(points):
    return np.stack([points[name].astype(np.float64) for name in "xyz"], axis=1)


def test_rays_fill_the_footprints_of_beams_in_equal_steps(sensors):
    frame = flash(sensors)
    assert frame.channel_counts.tolist() == [9] * 32
    places = xyz(frame.points).reshape(4, 8, 3, 3, 3)
    np.testing.assert_allclose(places[..., 0], 10.0, atol=1e-4)
    azimuth = np.degrees(np.arctan2(places[..., 1], places[..., 0]))
    elevation = np.degrees(np.arcsin(places[..., 2] / np.linalg.norm(places, axis=-1)))
    across = ((np.arange(8) + 0.5) / 8 - 0.5) * 40.0
    up = (0.5 - (np.arange(4) + 0.5) / 4) * 20.0
    cells = np.array([-5.0 / 3.0, 0.0, 5.0 / 3.0])
    expected = across[None, :, None, None] + cells
    np.testing.assert_allclose(azimuth, np.broadcast_to(expected, azimuth.shape), atol=1e-3)
    expected = up[:, None, None, None] - cells[None, None, :, None]
    np.testing.assert_allclose(elevation, np.broadcast_to(expected, azimuth.shape), atol=1e-3)


def test_a_ray_says_incidence_and_what_it_met(sensors):
    frame = flash(sensors, samples=1)
    places = xyz(frame.points)
    cosine = places[:, 0] / np.linalg.norm(places, axis=1)
    np.testing.assert_allclose(frame.points["cos_inc_angle"], cosine, atol=1e-5)
    assert set(frame.points["object_tag"]) == {Label.BUILDINGS}


def test_rays_that_meet_nothing_leave_their_beams_without_points(sensors):
    far = flash(sensors, range=math.hypot(10.0, 10.0 * math.tan(math.radians(10.0))), samples=1)
    assert set(far.channel_counts) == {0, 1}
    assert flash(sensors, range=5.0).channel_counts.tolist() == [0] * 32


@pytest.mark.parametrize(
    ("name", "value"), [("columns", 0), ("samples", 17), ("horizontal_fov", 400.0), ("range", -1)]
)
def test_what_no_array_has_is_refused(sensors, name, value):
    with pytest.raises(SensorAttributeError, match=name):
        flash(sensors, **{name: value})


def test_too_many_rays_are_refused(sensors):
    with pytest.raises(SensorAttributeError, match="rays are above"):
        flash(sensors, columns=2048, rows=2048)
