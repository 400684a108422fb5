"""Golden tests G6 and G7: corners, and boxes in the conventions of KITTI and nuScenes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from carstage import geometry as g

ACTOR = ([10.0, -4.0, 0.2], [1.0, 30.0, -2.0])
BOX = ([0.4, -0.1, 0.8], [0.0, 10.0, 0.0])
EXTENT = np.array([2.3, 0.95, 0.75])


def test_corners_follow_the_actor_pose_times_the_box_pose() -> None:
    pose = g.world_from_box(*ACTOR, *BOX)
    found = g.box_corners(pose, EXTENT)
    actor, box = g.rotation_matrix(ACTOR[1]), g.rotation_matrix(BOX[1])
    for corner, signs in zip(found, itertools.product((-1, 1), repeat=3), strict=True):
        in_actor = box @ (np.array(signs) * EXTENT) + BOX[0]
        np.testing.assert_allclose(corner, actor @ in_actor + ACTOR[0], atol=1e-12)


@pytest.mark.parametrize("times", [0, 2])
def test_the_box_location_counts_exactly_once(times: int) -> None:
    right = g.box_corners(g.world_from_box(*ACTOR, *BOX), EXTENT)
    wrong = g.world_from_box(*ACTOR, times * np.array(BOX[0]), BOX[1])
    assert np.abs(g.box_corners(wrong, EXTENT) - right).max() > 0.5


def test_corners_stand_in_libcarlas_order() -> None:
    expected = [
        [-1, -1, -1],
        [-1, -1, 1],
        [-1, 1, -1],
        [-1, 1, 1],
        [1, -1, -1],
        [1, -1, 1],
        [1, 1, -1],
        [1, 1, 1],
    ]
    np.testing.assert_array_equal(g.CORNER_SIGNS, expected)


def test_edges_join_corners_that_differ_in_one_sign() -> None:
    assert len(set(g.EDGES)) == 12
    for a, b in g.EDGES:
        assert np.count_nonzero(g.CORNER_SIGNS[a] != g.CORNER_SIGNS[b]) == 1


def test_upright_boxes_survive_kitti_and_back() -> None:
    rng = np.random.default_rng(11)
    for _ in range(2000):
        center, yaw = rng.uniform(-80, 80, 3), rng.uniform(-180, 180)
        extent, camera_yaw = rng.uniform(0.2, 6, 3), rng.uniform(-180, 180)
        camera = g.pose_matrix(rng.uniform(-5, 5, 3), [0.0, camera_yaw, 0.0])
        row = g.kitti_box(g.pose_matrix(center, [0.0, yaw, 0.0]), extent, camera)
        back_center, back_yaw, back_extent = g.carla_box_from_kitti(row, camera, camera_yaw)
        np.testing.assert_allclose(back_center, center, atol=1e-9)
        turn = g.wrap_angle(np.radians(back_yaw - yaw))
        assert np.degrees(abs(float(turn))) < 1e-9
        np.testing.assert_array_equal(back_extent, extent)


def test_boxes_of_any_rotation_survive_nuscenes_and_back() -> None:
    rng = np.random.default_rng(12)
    for _ in range(500):
        center, extent = rng.uniform(-80, 80, 3), rng.uniform(0.2, 6, 3)
        rotation = rng.uniform([-89, -180, -180], [89, 180, 180])
        box = g.nuscenes_box(g.pose_matrix(center, rotation), extent)
        back_center, back_rotation, back_extent = g.carla_box_from_nuscenes(box)
        np.testing.assert_allclose(back_center, center, atol=1e-9)
        np.testing.assert_allclose(
            g.rotation_matrix(back_rotation), g.rotation_matrix(rotation), atol=1e-12
        )
        np.testing.assert_array_equal(back_extent, extent)


def test_velodyne_points_reach_the_camera_as_through_the_world() -> None:
    rng = np.random.default_rng(13)
    camera = g.pose_matrix([1.5, 0.2, 1.6], [-3.0, 15.0, 1.0])
    lidar = g.pose_matrix([0.0, 0.0, 2.4], [1.0, -5.0, 2.0])
    points = rng.uniform(-60, 60, (200, 3))
    through_world = g.transform_points(
        g.optical_from_world(camera), g.transform_points(lidar, points)
    )
    direct = g.transform_points(g.velodyne_to_camera(camera, lidar), g.flu_vector(points))
    np.testing.assert_allclose(direct, through_world, atol=1e-9)


def test_colocated_camera_and_lidar_have_the_known_velodyne_matrix() -> None:
    pose = g.pose_matrix([3.0, 4.0, 2.0], [0.0, 70.0, 0.0])
    expected = [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0]]
    np.testing.assert_allclose(g.velodyne_to_camera(pose, pose)[:3], expected, atol=1e-12)


def test_rectangles_of_a_full_image_object() -> None:
    full = (0.0, 0.0, 1280.0, 720.0)
    assert g.kitti_rectangle(full, 1280, 720) == (0.0, 0.0, 1279.0, 719.0)
    assert g.coco_rectangle(full) == (0.0, 0.0, 1280.0, 720.0)
    assert g.yolo_rectangle(full, 1280, 720) == (0.5, 0.5, 1.0, 1.0)
