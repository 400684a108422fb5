"""Optical flow in CARLA's convention, checked against depth and poses (ground truth section 11)."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from carstage_sim.content.pedestrians import pedestrian_mesh, walking_joints
from carstage_sim.geometry import pose_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.sensors import WorldSensors
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.walkers.gait import walk_phase
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("kernels")

WIDTH, HEIGHT, FOV_DEG = 160, 90, 80.0
FOCAL = WIDTH / (2.0 * math.tan(math.radians(FOV_DEG) / 2.0))
LENS = {"image_size_x": WIDTH, "image_size_y": HEIGHT, "fov": FOV_DEG}
OPTICAL_FROM_SENSOR = np.array([[0, 1, 0], [0, 0, -1], [1, 0, 0]], float)
KINDS = {"optical_flow": 100, "depth": 101, "instance_segmentation": 102}

Pose = tuple[tuple[float, float, float], tuple[float, float, float]]


@pytest.fixture
def sensors(tmp_path_factory):
    with WorldSensors(
        town(GROUND, WALL), threads=1, cache=tmp_path_factory.getbasetemp() / "trees"
    ) as built:
        yield built


def look(sensors, world, pose: Pose, **attributes):
    """Flow in pixels (y down), depth in metres, tags and ids of one frame."""
    location, rotation = pose
    rig = [
        request(f"camera.{kind}", sensor_id, location=location, rotation_deg=rotation,
                **LENS, **attributes)
        for kind, sensor_id in KINDS.items()
    ]  # fmt: skip
    frames = dict(sensors.capture(world, rig))
    flow = frames[100].flow.astype(float) * (WIDTH / 2.0, -HEIGHT / 2.0)
    b, g, r = (frames[101].pixels[..., k].astype(float) for k in range(3))
    depth = (r + 256 * g + 65536 * b) * 1000 / (2**24 - 1)
    codes = frames[102].pixels.astype(int)
    return flow, depth, codes[..., 2], codes[..., 1] + 256 * codes[..., 0]


def predicted(depth, now: Pose, before: Pose, before_from_now=None):
    """Motion in pixels by back-projection into the world and projection into the last picture."""
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    ray = np.stack([(u - WIDTH / 2) / FOCAL, (v - HEIGHT / 2) / FOCAL, np.ones_like(u)], axis=-1)
    point = (ray * depth[..., None]) @ OPTICAL_FROM_SENSOR
    world_from_now, world_from_before = pose_matrix(*now), pose_matrix(*before)
    world = point @ world_from_now[:3, :3].T + world_from_now[:3, 3]
    if before_from_now is not None:
        world = world @ before_from_now[:3, :3].T + before_from_now[:3, 3]
    local = (world - world_from_before[:3, 3]) @ world_from_before[:3, :3]
    x, y, z = np.moveaxis(local @ OPTICAL_FROM_SENSOR.T, -1, 0)
    return np.stack([u - (FOCAL * x / z + WIDTH / 2), v - (FOCAL * y / z + HEIGHT / 2)], axis=-1)


def end_point_error(flow, expected, chosen):
    return np.linalg.norm(flow - expected, axis=-1)[chosen]


BEFORE: Pose = ((-15.0, 1.0, 2.0), (1.0, -4.0, 0.5))
NOW: Pose = ((-14.0, 1.2, 2.1), (-1.0, 3.0, -0.5))


def test_the_first_picture_shows_no_motion(sensors):
    flow, *_ = look(sensors, state(1), NOW)
    assert np.abs(flow).max() < 1e-4


def test_flow_agrees_with_depth_and_poses(sensors):
    look(sensors, state(1), BEFORE)
    flow, depth, *_ = look(sensors, state(2), NOW)
    error = end_point_error(flow, predicted(depth, NOW, BEFORE), depth < 999.0)
    assert len(error) > 5000
    assert np.median(error) < 1e-3
    assert error.max() < 0.05
    assert np.abs(flow).max() > 10.0


def test_flow_of_the_sky_is_that_of_the_rotation_alone(sensors):
    before: Pose = ((-15.0, 1.0, 2.0), (1.0, 174.0, 0.5))
    now: Pose = ((-14.0, 1.2, 2.1), (-1.0, 180.0, -0.5))
    look(sensors, state(1), before)
    flow, depth, tags, _ = look(sensors, state(2), now)
    far = predicted(np.full_like(depth, 1e12), now, before)
    sky = tags == CityObjectLabel.SKY
    assert sky.sum() > 500
    assert end_point_error(flow, far, sky).max() < 1e-3


def test_flow_of_a_moving_actor_follows_its_own_motion(sensors):
    was = ((2.0, -1.0, 0.0), (0.0, 60.0, 0.0))
    moved = ((3.0, 0.5, 0.0), (0.0, 85.0, 0.0))
    look(sensors, state(1, vehicles=[(7, was[0], was[1][1])]), BEFORE)
    flow, depth, tags, ids = look(sensors, state(2, vehicles=[(7, moved[0], moved[1][1])]), NOW)
    before_from_now = pose_matrix(*was) @ np.linalg.inv(pose_matrix(*moved))
    car = ids == 7
    assert car.sum() > 50
    error = end_point_error(flow, predicted(depth, NOW, BEFORE, before_from_now), car)
    assert np.median(error) < 1e-3
    still = end_point_error(flow, predicted(depth, NOW, BEFORE), car)
    assert np.median(still) > 1.0
    town_pixels = (ids != 7) & (tags != CityObjectLabel.SKY)
    assert end_point_error(flow, predicted(depth, NOW, BEFORE), town_pixels).max() < 0.05


def test_the_sign_is_current_minus_previous_with_y_upwards(sensors):
    # The camera goes right and up: what it sees goes left and down.
    look(sensors, state(1), ((0.0, 0.0, 20.0), (0.0, 0.0, 0.0)))
    rig = request("camera.optical_flow", 100, location=(0.0, 1.0, 20.5), **LENS)
    ((_, frame),) = sensors.capture(state(2), [rig])
    motion_px = FOCAL / 10.0  # the wall is 10 m away
    np.testing.assert_allclose(frame.flow[..., 0], -motion_px / (WIDTH / 2), rtol=1e-4)
    np.testing.assert_allclose(frame.flow[..., 1], -0.5 * motion_px / (HEIGHT / 2), rtol=1e-4)


def test_motion_ends_at_twice_the_picture(sensors):
    look(sensors, state(1), ((0.0, 0.0, 20.0), (0.0, 0.0, 0.0)))
    rig = request("camera.optical_flow", 100, rotation_deg=(0.0, 120.0, 0.0), **LENS)
    ((_, frame),) = sensors.capture(state(2), [rig])
    assert np.isfinite(frame.flow).all()
    assert np.abs(frame.flow).max() == 2.0


def test_flow_spans_the_ticks_that_sensor_tick_leaves_out(sensors):
    poses = [((-15.0 + 0.3 * k, 0.0, 2.0), (0.0, float(k), 0.0)) for k in range(4)]
    for k, pose in enumerate(poses[:3]):
        given = sensors.capture(
            state(1 + k),
            [request("camera.optical_flow", 100, location=pose[0], rotation_deg=pose[1],
                     sensor_tick=0.3, **LENS)],
        )  # fmt: skip
        assert len(given) == int(k == 0)
    flow, depth, *_ = look(sensors, state(4), poses[3], sensor_tick=0.3)
    error = end_point_error(flow, predicted(depth, poses[3], poses[0]), depth < 999.0)
    assert np.median(error) < 1e-3


def test_an_actor_that_is_new_has_not_moved(sensors):
    look(sensors, state(1), NOW)
    flow, _, _, ids = look(sensors, state(2, vehicles=[(7, (0.0, 0.0, 0.0), 20.0)]), NOW)
    assert (ids == 7).sum() > 50
    assert np.abs(flow).max() < 1e-4


WALKED_M = 0.25
"""Between two pictures: the figure's pose changes."""


def walking(frame: int, *, step_m: float = WALKED_M, yaw: float = 90.0):
    """A frame in which one walks past the camera."""
    heading = math.radians(yaw)
    way = np.array([math.cos(heading), math.sin(heading), 0.0])
    place = np.array([-9.0, -0.6, 0.93]) + (frame - 2) * step_m * way
    velocity = tuple(float(v) for v in way * step_m * 10.0)
    return state(frame, walkers=[(9, tuple(place.tolist()), yaw)], velocity=velocity)


def figure_of(world):
    """``(T, 3, 3)`` corners of the walker's triangles in the world, from its joints."""
    blueprint = catalogue()["walker.pedestrian.0001"]
    extent = blueprint.box_extent
    phase = walk_phase(9, world.location[0], world.rotation_deg[0, 1], world.velocity[0], extent)
    joints = walking_joints(blueprint.id, extent, phase)
    mesh = pedestrian_mesh(blueprint.id, blueprint.box_extent, joints)
    pose = pose_matrix(world.location[0], world.rotation_deg[0])
    return mesh.vertices[mesh.triangles].astype(float) @ pose[:3, :3].T + pose[:3, 3]


def nearest_on_triangles(point, corners):
    """Number and ``(3,)`` weights of the triangle that holds a point, by the smallest distance."""
    a, b, c = np.moveaxis(corners, 1, 0)
    edges = np.stack([b - a, c - a], axis=2)
    pinv = np.linalg.pinv(edges)
    uv = np.einsum("tij,tj->ti", pinv, point - a)
    u, v = np.clip(uv[:, 0], 0, 1), np.clip(uv[:, 1], 0, 1)
    over = np.maximum(u + v, 1.0)
    weights = np.stack([1 - u / over - v / over, u / over, v / over], axis=1)
    gap = np.linalg.norm(np.einsum("tk,tki->ti", weights, corners) - point, axis=1)
    return int(gap.argmin()), weights[gap.argmin()]


def test_flow_of_a_walker_follows_its_limbs(sensors):
    before, now = walking(1), walking(2)
    look(sensors, before, BEFORE)
    flow, depth, _, ids = look(sensors, now, NOW)
    corners, corners_before = figure_of(now), figure_of(before)
    assert np.abs(corners - corners_before - (0.0, WALKED_M, 0.0)).max() > 0.05
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    ray = np.stack([(u - WIDTH / 2) / FOCAL, (v - HEIGHT / 2) / FOCAL, np.ones_like(u)], axis=-1)
    pose, pose_before = pose_matrix(*NOW), pose_matrix(*BEFORE)
    points = (ray * depth[..., None]) @ OPTICAL_FROM_SENSOR @ pose[:3, :3].T + pose[:3, 3]
    errors, limbs = [], 0
    for j, i in np.argwhere(ids == 9):
        triangle, weights = nearest_on_triangles(points[j, i], corners)
        was = weights @ corners_before[triangle]
        limbs += np.linalg.norm(points[j, i] - was - (0.0, WALKED_M, 0.0)) > 0.03
        x, y, z = ((was - pose_before[:3, 3]) @ pose_before[:3, :3]) @ OPTICAL_FROM_SENSOR.T
        place = (FOCAL * x / z + WIDTH / 2, FOCAL * y / z + HEIGHT / 2)
        errors.append(
            np.hypot(u[j, i] - place[0] - flow[j, i, 0], v[j, i] - place[1] - flow[j, i, 1])
        )
    assert len(errors) > 150
    assert limbs > 40
    # Depth has steps: where two limbs meet, another triangle may be the nearest.
    assert np.quantile(errors, 0.98) < 0.02


def between_pixels(picture, x, y):
    """``(N, 3)`` colours of a picture at places in pixels, bilinear."""
    x = np.clip(x, 0, picture.shape[1] - 1.001)
    y = np.clip(y, 0, picture.shape[0] - 1.001)
    i, j = x.astype(int), y.astype(int)
    right, down = (x - i)[:, None], (y - j)[:, None]
    top = picture[j, i] * (1 - right) + picture[j, i + 1] * right
    below = picture[j + 1, i] * (1 - right) + picture[j + 1, i + 1] * right
    return top * (1 - down) + below * down


@pytest.mark.parametrize("step_m", [0.07, 0.15])
@pytest.mark.parametrize("yaw", [90.0, -60.0, 20.0])
def test_warping_with_flow_explains_pedestrians(sensors, step_m, yaw):
    """Each picture is the one before, moved by the flow, on a pedestrian's pixels too."""
    # Fine enough for faces and patterns of clothes, which else differ by being sampled twice.
    lens = LENS | {"image_size_x": 4 * WIDTH, "image_size_y": 4 * HEIGHT}
    pictures, errors = [], []
    for frame in range(1, 9):
        rig = [
            request(f"camera.{kind}", 200 + k, location=(-14 + 0.05 * frame, 0, 1.6), **lens)
            for k, kind in enumerate(("rgb", "optical_flow", "instance_segmentation"))
        ]
        frames = dict(sensors.capture(walking(frame, step_m=step_m, yaw=yaw), rig))
        flow = frames[201].flow.astype(float) * (2 * WIDTH, -2 * HEIGHT)
        walker = frames[202].pixels[..., 1] == 9
        pictures.append((frames[200].pixels[..., :3].astype(float), flow, walker))
    for (before, _, _), (now, flow, walker) in itertools.pairwise(pictures):
        y, x = np.nonzero(walker)
        warped = between_pixels(before, x - flow[walker][:, 0], y - flow[walker][:, 1])
        assert len(x) > 500
        errors.append((np.abs(warped - now[walker]).mean(), np.abs(before - now)[walker].mean()))
    assert all(warped < still for warped, still in errors)
    warped, still = np.mean(errors, axis=0)
    assert warped < 0.25 * still  # a rigid body's flow leaves 0.3 to 0.5
