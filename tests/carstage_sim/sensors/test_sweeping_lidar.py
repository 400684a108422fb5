"""The LiDAR whose points are each of their own instant, against walls and cars that we place."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carstage_sim.geometry import rotation_matrix
from carstage_sim.render.scene import Frame
from carstage_sim.sensors import SensorAttributeError, WorldSensors
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

CHANNELS, COLUMNS, SPAN_S = 8, 500, 0.1
EVEN = {
    "channels": CHANNELS, "points_per_second": int(CHANNELS * COLUMNS / SPAN_S),
    "rotation_frequency": 10.0, "range": 150.0, "dropoff_general_rate": 0.0,
    "dropoff_zero_intensity": 0.0, "upper_fov": 10.0, "lower_fov": -20.0,
}  # fmt: skip


@pytest.fixture
def sensors(tmp_path):
    with WorldSensors(town(GROUND, WALL), threads=1, cache=tmp_path) as built:
        yield built


def sweep(sensors, *poses, world=None, **attributes):
    """Points and motion of the last of some ticks, a pose of the sensor for each."""
    for k, (location, yaw_deg) in enumerate(poses, start=1):
        asked = request(
            "lidar.ray_cast_sweeping", location=location, rotation_deg=(0.0, yaw_deg, 0.0),
            **(EVEN | attributes),
        )  # fmt: skip
        ((_, frame),) = sensors.capture(world[k - 1] if world else state(k), [asked])
    assert frame.channel_counts.tolist()[-1] == 1
    assert frame.channel_counts.sum() == len(frame.points)
    return frame.points[:-1], frame.points[-1:].view(np.float32).astype(np.float64)


def xyz(points):
    return np.stack([points[name].astype(np.float64) for name in "xyz"], axis=1)


def ages_s(points):
    return points["object_idx"].astype(np.float64) * 1e-6


def test_a_wall_is_off_by_velocity_times_age_until_the_motion_is_undone(sensors):
    points, motion = sweep(sensors, ((-2.0, 0.0, 2.0), 0.0), ((0.0, 0.0, 2.0), 0.0))
    assert motion == pytest.approx([20.0, 0, 0, 0, 0, 0], abs=1e-5)
    places, age_s = xyz(points), ages_s(points)
    on_wall = places[:, 2] + 2.0 > 0.05
    assert on_wall.sum() > 500
    # The wall is 10 m ahead at the end, and was farther by what the sensor drove since.
    np.testing.assert_allclose(places[on_wall, 0], 10.0 + 20.0 * age_s[on_wall], atol=1e-3)
    assert age_s[on_wall].max() - age_s[on_wall].min() > 0.04


def test_ages_follow_the_azimuth_and_channels_their_elevation(sensors):
    points, _ = sweep(sensors, ((-2.0, 0.0, 2.0), 0.0), ((0.0, 0.0, 2.0), 0.0))
    places = xyz(points)
    azimuth = np.arctan2(places[:, 1], places[:, 0])
    turned = (azimuth + math.pi) / (2.0 * math.pi)
    np.testing.assert_allclose(ages_s(points), SPAN_S * (1.0 - turned), atol=2e-6)
    elevation = np.degrees(np.arctan2(places[:, 2], np.hypot(places[:, 0], places[:, 1])))
    np.testing.assert_allclose(elevation, 10.0 - points["object_tag"] * 30.0 / 7.0, atol=1e-3)


def test_turning_and_driving_points_lie_on_the_wall_where_each_was_measured(sensors):
    before, now = ((-2.0, -1.0, 2.0), 40.0), ((0.0, 0.0, 2.2), 46.0)
    points, motion = sweep(sensors, before, now)
    places, part = xyz(points), ages_s(points) / SPAN_S
    # A rotation about one axis: half its tangent grows evenly, so the angle nearly does.
    tangent = math.tan(math.radians(6.0) / 2.0)
    yaw = 46.0 - 2.0 * np.degrees(np.arctan(part * tangent))
    turned = rotation_matrix(np.stack([0 * yaw, yaw, 0 * yaw], axis=1)).reshape(-1, 3, 3)
    location = np.array(now[0]) - part[:, None] * (np.array(now[0]) - before[0])
    world = np.einsum("nij,nj->ni", turned, places) + location
    on_ground, on_wall = np.abs(world[:, 2]) < 2e-3, np.abs(world[:, 0] - 10.0) < 2e-3
    assert np.all(on_ground | on_wall)
    assert on_ground.sum() > 500
    assert on_wall.sum() > 100
    assert motion[3:] == pytest.approx([0.0, 0.0, 2.0 * tangent / SPAN_S], abs=1e-5)


def test_at_rest_it_measures_what_the_frozen_lidar_does(sensors):
    stands = [((0.0, 0.0, 2.0), 10.0)] * 2
    points, motion = sweep(sensors, *stands)
    asked = request("lidar.ray_cast", 7, rotation_deg=(0.0, 10.0, 0.0), **EVEN)
    ((_, frozen),) = sensors.capture(state(3), [asked])
    assert not motion.any()
    np.testing.assert_allclose(xyz(points), frozen.points[:, :3], atol=1e-4)
    np.testing.assert_allclose(points["cos_inc_angle"], frozen.points[:, 3], atol=1e-5)


def test_a_car_is_met_where_it_was_at_each_instant(sensors):
    far = -30.0
    there = [state(1, vehicles=[(5, (far, -3.0, 0.0), 0.0)]),
             state(2, vehicles=[(5, (far, 0.0, 0.0), 0.0)])]  # fmt: skip
    stands = [((0.0, 0.0, 1.0), 180.0)] * 2
    columns = {"points_per_second": CHANNELS * 20_000 * 10, "lower_fov": -0.5, "upper_fov": 0.5}
    points, _ = sweep(sensors, *stands, world=there, **columns)
    places, age_s = xyz(points), ages_s(points)
    car = (np.abs(places[:, 0] - 30.0) < 5.0) & (np.abs(places[:, 1]) < 5.0)
    assert car.sum() > 100
    # It drives at 30 m/s across; the ray that passes straight ahead does so in the middle.
    middle = -places[car, 1] + 30.0 * age_s[car]
    width_m = 2.0 * 1.09
    assert middle.max() < width_m / 2 + 0.05
    assert middle.min() > -width_m / 2 - 0.05
    frozen = request(
        "lidar.ray_cast", 7, location=(0.0, 0.0, 1.0), rotation_deg=(0.0, 180.0, 0.0),
        **(EVEN | columns),
    )  # fmt: skip
    ((_, still),) = sensors.capture(state(3, vehicles=[(5, (far, 0.0, 0.0), 0.0)]), [frozen])
    near = (np.abs(still.points[:, 0] - 30.0) < 5.0) & (np.abs(still.points[:, 1]) < 5.0)
    seen = still.points[near]
    assert abs(float(seen[:, 1].mean()) - float(places[car, 1].mean())) > 1.0


def test_before_a_last_tick_the_velocity_tells_and_after_a_jump_nothing_moves(sensors):
    jump, motion = sweep(sensors, ((-100.0, 0.0, 2.0), 0.0), ((0.0, 0.0, 2.0), 0.0))
    assert not motion.any()
    assert np.abs(xyz(jump)[:, 0].max() - 10.0) < 1e-3
    carried = state(1, vehicles=[(100, (0.0, 0.0, 0.0), 0.0)], velocity=(8.0, 0.0, 0.0))
    sensors.reset()
    _, motion = sweep(sensors, ((0.0, 0.0, 2.0), 0.0), world=[carried])
    assert motion[:3] == pytest.approx([8.0, 0.0, 0.0], abs=1e-5)


def test_drop_off_and_noise_are_those_of_the_other_lidar(sensors):
    stands = [((0.0, 0.0, 2.0), 0.0)] * 2
    whole, _ = sweep(sensors, *stands)
    sensors.reset()
    fewer, _ = sweep(sensors, *stands, dropoff_general_rate=0.45)
    assert 0.5 * len(whole) < len(fewer) < 0.6 * len(whole)
    sensors.reset()
    noisy, _ = sweep(sensors, *stands, noise_stddev=0.1, noise_seed=5)
    off = np.linalg.norm(xyz(noisy), axis=1) - np.linalg.norm(xyz(whole), axis=1)
    assert 0.09 < off.std() < 0.11


def test_no_rays_and_impossible_values(sensors):
    points, _ = sweep(sensors, *[((0.0, 0.0, 2.0), 0.0)] * 2, points_per_second=0)
    assert len(points) == 0
    bad = request("lidar.ray_cast_sweeping", 9, **(EVEN | {"noise_stddev": -1.0}))
    with pytest.raises(SensorAttributeError):
        sensors.capture(state(9), [bad])


def test_who_moves_fast_makes_no_more_than_200_scenes(sensors, monkeypatch):
    far = -30.0
    there = [state(k, vehicles=[(5, (far, y, 0.0), 0.0)]) for k, y in ((1, -14.0), (2, 0.0))]
    stands = [((0.0, 0.0, 1.0), 180.0)] * 2
    made = []
    moved = Frame.moved
    monkeypatch.setattr(Frame, "moved", lambda *some: made.append(1) or moved(*some))
    sweep(sensors, *stands, world=there)
    assert 100 < len(made) <= 200
