"""Axes of other formats, each checked against the way through CARLA's world."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from carstage.exporters import axes
from carstage.geometry import (
    KittiBox,
    carla_box_from_kitti,
    carla_box_from_nuscenes,
    invert_pose,
    kitti_box,
    matrix_from_quaternion,
    nuscenes_box,
    optical_from_world,
    pose_matrix,
    transform_points,
)

Vector = tuple[float, float, float]
metres = st.floats(-500.0, 500.0)
locations = st.tuples(metres, metres, st.floats(-20.0, 20.0))
tilted = st.tuples(st.floats(-80.0, 80.0), st.floats(-180.0, 180.0), st.floats(-180.0, 180.0))
extents = st.tuples(*[st.floats(0.1, 8.0)] * 3)
POINTS = np.array([[12.0, -3.0, 1.0], [5.0, 4.0, -2.0], [40.0, 0.5, 0.0]], np.float64)
MIRROR = np.diag([1.0, -1.0, 1.0])

pytestmark = pytest.mark.xdist_group("export")


def with_intensity(points: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.column_stack([points, np.full(len(points), 0.5)]).astype(np.float32)


@settings(max_examples=40)
@given(locations, tilted, locations, tilted)
def test_a_point_goes_the_same_way_through_kitti_as_through_the_world(
    camera_at: Vector, camera_turned: Vector, lidar_at: Vector, lidar_turned: Vector
) -> None:
    world_from_camera = pose_matrix(camera_at, camera_turned)
    world_from_lidar = pose_matrix(lidar_at, lidar_turned)
    velodyne = axes.flu_points(with_intensity(POINTS))[:, :3].astype(np.float64)
    by_kitti = transform_points(
        axes.velodyne_to_camera(world_from_camera, world_from_lidar), velodyne
    )
    by_world = transform_points(
        optical_from_world(world_from_camera) @ world_from_lidar, POINTS.astype(np.float32)
    )
    np.testing.assert_allclose(by_kitti, by_world, atol=1e-9)


@settings(max_examples=40)
@given(locations, tilted, locations, tilted)
def test_a_point_of_a_nuscenes_lidar_lands_where_carla_puts_it(
    ego_at: Vector, ego_turned: Vector, lidar_at: Vector, lidar_turned: Vector
) -> None:
    world_from_ego, ego_from_lidar = (
        pose_matrix(ego_at, ego_turned),
        pose_matrix(lidar_at, lidar_turned),
    )
    points = axes.nuscenes_lidar_points(with_intensity(POINTS), np.zeros(3, np.float32))
    chain = axes.enu_pose(world_from_ego) @ axes.flu_from_nuscenes_lidar(ego_from_lidar)
    expected = transform_points(world_from_ego @ ego_from_lidar, POINTS) @ MIRROR
    np.testing.assert_allclose(
        transform_points(chain, points[:, :3].astype(np.float64)), expected, atol=1e-9
    )


@settings(max_examples=40)
@given(locations, tilted, locations, tilted)
def test_a_camera_of_nuscenes_sees_what_carla_s_sees(
    ego_at: Vector, ego_turned: Vector, camera_at: Vector, camera_turned: Vector
) -> None:
    world_from_ego = pose_matrix(ego_at, ego_turned)
    ego_from_camera = pose_matrix(camera_at, camera_turned)
    chain = axes.enu_pose(world_from_ego) @ axes.flu_from_optical(ego_from_camera)
    optical = transform_points(invert_pose(chain), POINTS @ MIRROR)
    expected = transform_points(optical_from_world(world_from_ego @ ego_from_camera), POINTS)
    np.testing.assert_allclose(optical, expected, atol=1e-9)


@settings(max_examples=40)
@given(locations, tilted)
def test_poses_of_other_formats_are_proper_rotations(at: Vector, turned: Vector) -> None:
    pose = pose_matrix(at, turned)
    for change in (
        axes.flu_pose,
        axes.enu_pose,
        axes.flu_from_optical,
        axes.flu_from_nuscenes_lidar,
        axes.imu_to_velodyne,
    ):
        rotation = change(pose)[:3, :3]
        assert abs(np.linalg.det(rotation) - 1.0) < 1e-9
        again = matrix_from_quaternion(axes.quaternion_from_matrix(rotation))
        np.testing.assert_allclose(again, rotation, atol=1e-9)


@settings(max_examples=40)
@given(locations, st.floats(-180.0, 179.9), locations, st.floats(-180.0, 179.9), extents)
def test_upright_boxes_come_back_from_kitti(
    at: Vector, yaw_deg: float, camera_at: Vector, camera_yaw_deg: float, extent: Vector
) -> None:
    world_from_camera = pose_matrix(camera_at, (0.0, camera_yaw_deg, 0.0))
    box: KittiBox = kitti_box(pose_matrix(at, (0.0, yaw_deg, 0.0)), extent, world_from_camera)
    center, yaw, size = carla_box_from_kitti(box, world_from_camera, camera_yaw_deg)
    np.testing.assert_allclose(center, at, atol=1e-9)
    assert abs((yaw - yaw_deg + 180.0) % 360.0 - 180.0) < 1e-9
    np.testing.assert_allclose(size, extent, rtol=1e-12)


@settings(max_examples=40)
@given(locations, tilted, extents)
def test_boxes_come_back_from_nuscenes(at: Vector, turned: Vector, extent: Vector) -> None:
    center, rotation, size = carla_box_from_nuscenes(nuscenes_box(pose_matrix(at, turned), extent))
    np.testing.assert_allclose(center, at, atol=1e-9)
    np.testing.assert_allclose(pose_matrix(at, rotation), pose_matrix(at, turned), atol=1e-9)
    np.testing.assert_allclose(size, extent, rtol=1e-12)


def test_radar_detections_become_points_and_speeds_to_the_left_and_up() -> None:
    places, velocities = axes.radar_points(np.array([[-5.0, 0.1, 0.05, 30.0]]))
    np.testing.assert_allclose(places, [[29.812820, -2.991260, 1.499375]], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(velocities, axis=1), [5.0])
    assert velocities[0, 0] < 0.0  # it approaches


def test_no_other_module_of_the_exporters_changes_axes() -> None:
    package = Path(axes.__file__).parent
    names = ("FLU_FROM_CARLA", "OPTICAL_FROM_SENSOR", "NUSCENES_LIDAR_FROM_SENSOR", "[1, -1, 1")
    others = [path for path in package.rglob("*.py") if path.name != "axes.py"]
    assert len(others) > 10
    for path in others:
        text = path.read_text()
        assert not [name for name in names if name in text], path
