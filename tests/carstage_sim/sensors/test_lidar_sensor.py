"""CARLA's LiDAR: rays per tick, azimuths, header angle, intensity, drop-off and noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.sensors import SensorAttributeError, WorldSensors
from carstage_sim.sensors.lidar import LidarGeometry, laser_directions, round_half_away
from carstage_sim.world.blueprints import catalogue
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

FULL = {
    "channels": 16, "points_per_second": 64000, "rotation_frequency": 10.0, "range": 150.0,
    "dropoff_general_rate": 0.0, "dropoff_zero_intensity": 0.0, "upper_fov": 15.0,
    "lower_fov": -25.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def sensors(tmp_path_factory):
    with WorldSensors(
        town(GROUND, WALL), threads=1, cache=tmp_path_factory.mktemp("trees")
    ) as built:
        yield built


def scan(sensors, world=None, **attributes):
    ((_, frame),) = sensors.capture(
        world or state(1), [request("lidar.ray_cast", **(FULL | attributes))]
    )
    return frame


@pytest.mark.parametrize(
    ("points_per_second", "delta_s", "channels", "rays"),
    [(1.3e6, 0.05, 64, 1016), (56000, 0.05, 32, 88), (56000, 0.1, 32, 175)],
)
def test_rays_per_laser_round_half_away(points_per_second, delta_s, channels, rays):
    # D9.
    geometry = LidarGeometry(channels, points_per_second, 20.0, 10.0, -30.0, 360.0)
    assert geometry.sweep(0.0, delta_s).per_channel == rays


def test_rounding_goes_up_from_the_half():
    assert [round_half_away(v) for v in (0.0, 0.49, 0.5, 87.5, 1015.6)] == [0, 0, 1, 88, 1016]


def test_a_sweep_starts_behind_and_turns_clockwise():
    sweep = LidarGeometry(4, 4000, 10.0, 10.0, -10.0, 360.0).sweep(0.0, 0.1)
    assert sweep.per_channel == 100
    assert sweep.azimuth_rad[0] == pytest.approx(-math.pi)
    assert np.allclose(np.diff(sweep.azimuth_rad), math.radians(3.6))
    assert sweep.end_angle_deg == pytest.approx(0.0, abs=1e-9)


def test_half_a_turn_goes_on_where_it_ended(sensors):
    sensor = request("lidar.ray_cast", **(FULL | {"rotation_frequency": 5.0}))
    angles = [sensors.capture(state(k), [sensor])[0][1].horizontal_angle_rad for k in (1, 2, 3)]
    assert angles == pytest.approx([math.pi, 0.0, math.pi], abs=1e-6)


def test_lasers_are_even_from_top_to_bottom():
    geometry = LidarGeometry(5, 1000, 10.0, 10.0, -30.0, 360.0)
    assert np.degrees(geometry.elevation_rad).tolist() == pytest.approx([10, 0, -10, -20, -30])
    assert np.degrees(LidarGeometry(1, 1, 1.0, 7.0, -3.0, 360.0).elevation_rad).tolist() == [7.0]
    rays = laser_directions(np.radians([10.0, -20.0]), np.radians([0.0, 90.0]))
    assert rays[0].tolist() == pytest.approx([0.98480775, 0.0, 0.17364818])
    assert rays[3].tolist() == pytest.approx([0.0, 0.93969262, -0.34202014], abs=1e-7)


def test_every_ray_has_the_elevation_of_its_laser_and_the_azimuth_of_its_turn():
    up, turn = np.radians([10.0, 0.3, -20.0]), np.linspace(-3.0, 3.0, 37)
    rays = laser_directions(up, turn).reshape(3, 37, 3)
    for (laser, step), _ in np.ndenumerate(rays[..., 0]):
        level = np.cos(up[laser])
        wanted = level * np.cos(turn[step]), level * np.sin(turn[step]), np.sin(up[laser])
        assert rays[laser, step].tolist() == pytest.approx(wanted, abs=1e-15)


def test_points_lie_on_the_surfaces_grouped_by_channel(sensors):
    frame = scan(sensors)
    points = frame.points.astype(np.float64)
    assert frame.channel_counts.sum() == len(points)
    world = points[:, :3] + [0.0, 0.0, 2.0]
    on_ground = np.abs(world[:, 2]) < 2e-3
    on_wall = np.abs(world[:, 0] - 10.0) < 2e-3
    assert np.all(on_ground | on_wall)
    assert on_ground.any()
    assert on_wall.any()
    elevation = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
    channel = np.repeat(np.arange(16), frame.channel_counts)
    assert np.allclose(elevation, 15.0 - channel * 40.0 / 15, atol=0.01)


def test_intensity_falls_with_distance_and_misses_give_no_points(sensors):
    frame = scan(sensors, atmosphere_attenuation_rate=0.01)
    distance = np.linalg.norm(frame.points[:, :3], axis=1)
    assert np.allclose(frame.points[:, 3], np.exp(-0.01 * distance), atol=1e-4)
    assert len(frame.points) < 16 * 400
    assert distance.max() <= 150.001


def test_drop_off_takes_its_share_and_keeps_strong_returns(sensors):
    whole = len(scan(sensors).points)
    assert 0.52 * whole < len(scan(sensors, dropoff_general_rate=0.45).points) < 0.58 * whole
    strict = scan(
        sensors, dropoff_zero_intensity=1.0, dropoff_intensity_limit=0.97,
        atmosphere_attenuation_rate=0.02,
    )  # fmt: skip
    assert len(strict.points) < whole
    strong = scan(
        sensors, dropoff_zero_intensity=1.0, dropoff_intensity_limit=0.2,
        atmosphere_attenuation_rate=0.0,
    )  # fmt: skip
    assert len(strong.points) == whole


def test_noise_is_along_the_ray_and_follows_the_seed(sensors):
    clean = scan(sensors).points[:, :3].astype(np.float64)
    noisy = scan(sensors, noise_stddev=0.1, noise_seed=5).points[:, :3].astype(np.float64)
    shift = np.linalg.norm(noisy, axis=1) - np.linalg.norm(clean, axis=1)
    assert 0.09 < shift.std() < 0.11
    assert np.abs(np.cross(noisy, clean)).max() < 1e-2
    again = scan(sensors, noise_stddev=0.1, noise_seed=5).points
    other = scan(sensors, noise_stddev=0.1, noise_seed=6).points
    assert np.array_equal(again[:, :3], noisy.astype(np.float32))
    assert not np.array_equal(other, again)


def test_the_carrier_is_hit_from_outside_but_not_from_within(sensors):
    world = state(1, vehicles=[(3, (0.0, 0.0, 0.0), 0.0)])

    def nearest(height):
        sensor = request("lidar.ray_cast", location=(0, 0, height), owner_id=3, **FULL)
        ((_, frame),) = sensors.capture(world, [sensor])
        points = frame.points[:, :3] + np.array([0, 0, height], np.float32)
        return points[(np.abs(points[:, 0]) < 2.3) & (points[:, 2] > 0.4)]

    assert len(nearest(1.9)) > 0
    assert len(nearest(1.0)) == 0


def test_a_slower_sensor_tick_covers_the_time_between(sensors):
    sensor = request("lidar.ray_cast", **(FULL | {"sensor_tick": 0.2, "rotation_frequency": 5.0}))
    frames = [sensors.capture(state(k), [sensor]) for k in (1, 2, 3)]
    assert [len(f) for f in frames] == [1, 0, 1]
    third = frames[2][0][1]
    azimuth = np.degrees(np.arctan2(third.points[:, 1], third.points[:, 0]))
    assert np.histogram(azimuth, bins=36, range=(-180, 180))[0].min() > 0


@pytest.mark.parametrize(
    ("name", "value"), [("channels", 0), ("range", -1), ("horizontal_fov", 400), ("range", "far")]
)
def test_an_impossible_lidar_is_refused_by_the_attributes_name(sensors, name, value):
    with pytest.raises(SensorAttributeError, match=name):
        scan(sensors, **{name: value})


def test_lidar_and_depth_camera_see_the_same_town(sensors):
    world = state(1, vehicles=[(3, (6.0, 1.0, 0.0), 30.0), (4, (8.0, -6.0, 0.0), 90.0)])
    pose = {"location": (0.3, -0.2, 1.8), "rotation_deg": (-3.0, 10.0, 1.0)}
    lidar = request("lidar.ray_cast", 1, **pose, **(FULL | {"points_per_second": 320000}))
    depth = request("camera.depth", 2, **pose, image_size_x=320, image_size_y=240)
    tags = request("camera.semantic_segmentation", 3, **pose, image_size_x=320, image_size_y=240)
    frames = dict(sensors.capture(world, [lidar, depth, tags]))
    points = frames[1].points[:, :3].astype(np.float64)
    points = points[points[:, 0] > 1.0]
    column = 160 + 160 * points[:, 1] / points[:, 0]
    row = 120 - 160 * points[:, 2] / points[:, 0]
    inside = (column >= 0) & (column < 320) & (row >= 0) & (row < 240)
    i, j = column[inside].astype(int), row[inside].astype(int)
    b, g, r = (frames[2].pixels[..., k].astype(float) for k in range(3))
    seen = ((r + 256 * g + 65536 * b) * 1000 / (2**24 - 1))[j, i]
    error = np.abs(seen - points[inside, 0])
    agree = error < 0.1 + 0.02 * points[inside, 0]
    assert inside.sum() > 2000
    assert agree.mean() > 0.98
    assert (frames[3].pixels[j, i, 2] == CityObjectLabel.CAR).sum() > 100


def semantic_scan(sensors, world=None, location=(0.0, 0.0, 2.0), **attributes):
    plain = {name: value for name, value in FULL.items() if not name.startswith("dropoff")}
    sensor = request("lidar.ray_cast_semantic", location=location, **(plain | attributes))
    ((_, frame),) = sensors.capture(world or state(1), [sensor])
    return frame


def test_semantic_lidar_has_the_points_of_a_lidar_without_losses(sensors):
    plain, semantic = scan(sensors), semantic_scan(sensors)
    assert semantic.horizontal_angle_rad == plain.horizontal_angle_rad
    np.testing.assert_array_equal(semantic.channel_counts, plain.channel_counts)
    for axis, name in enumerate("xyz"):
        np.testing.assert_array_equal(semantic.points[name], plain.points[:, axis])


def test_semantic_lidar_says_what_a_point_lies_on(sensors):
    world = state(1, vehicles=[(2**24 + 1, (6.0, 0.0, 0.0), 90.0)])
    points = semantic_scan(sensors, world).points
    on_car = points["object_tag"] == CityObjectLabel.CAR
    assert on_car.sum() > 20
    assert set(points["object_idx"][on_car].tolist()) == {2**24 + 1}
    assert set(points["object_idx"][~on_car].tolist()) == {0}
    assert set(points["object_tag"][~on_car].tolist()) == {
        CityObjectLabel.BUILDINGS,
        CityObjectLabel.ROADS,
    }


def test_semantic_lidar_gives_the_cosine_of_incidence(sensors):
    points = semantic_scan(sensors).points
    place = np.stack([points[name] for name in "xyz"], axis=-1).astype(float)
    ray = place / np.linalg.norm(place, axis=1, keepdims=True)
    ground = points["object_tag"] == CityObjectLabel.ROADS
    np.testing.assert_allclose(points["cos_inc_angle"][ground], -ray[ground, 2], atol=1e-5)
    front = (points["object_tag"] == CityObjectLabel.BUILDINGS) & (np.abs(place[:, 0] - 10) < 1e-3)
    np.testing.assert_allclose(points["cos_inc_angle"][front], ray[front, 0], atol=1e-5)


def test_hits_of_a_car_lie_in_its_box_whatever_the_poses(sensors):
    # L3: at least 95 % of an actor's hits lie in its box inflated by 0.1 m.
    car, yaw_deg = (5.0, 2.0, 0.0), 35.0
    location, rotation_deg = (0.0, -1.0, 1.8), (-5.0, 20.0, 3.0)
    world = state(1, vehicles=[(3, car, yaw_deg)])
    points = semantic_scan(sensors, world, location=location, rotation_deg=rotation_deg).points
    hits = points[points["object_idx"] == 3]
    assert len(hits) > 100
    local = np.stack([hits[name] for name in "xyz"], axis=-1).astype(float)
    place = local @ rotation_matrix(rotation_deg).T + location
    blueprint = catalogue()["vehicle.tesla.model3"]
    in_box = (place - car) @ rotation_matrix((0.0, yaw_deg, 0.0)) - blueprint.box_center
    inside = (np.abs(in_box) <= np.array(blueprint.box_extent) + 0.1).all(axis=1)
    assert inside.mean() >= 0.95
