"""Golden tests G4, G5, G8-G11 and D2: intrinsics, projection, angles, ranges."""

from __future__ import annotations

import numpy as np
import pytest

from carstage import geometry as g
from carstage.errors import BadInputError

K = g.intrinsics(1280, 720, 90.0)


@pytest.mark.parametrize(
    ("width", "fov_deg", "focal"),
    [
        (1280, 90.0, 640.0),
        (800, 90.0, 400.0),
        (1920, 70.0, 1371.0220865),
    ],
)
def test_focal_length_follows_from_the_horizontal_field_of_view(
    width: int, fov_deg: float, focal: float
) -> None:
    assert g.focal_length_px(width, fov_deg) == pytest.approx(focal, abs=1e-7)


def test_kittis_focal_length_is_reached_by_its_field_of_view() -> None:
    assert g.focal_length_px(1242, 81.4346) == pytest.approx(721.5377, abs=1e-3)


def test_a_fractional_field_of_view_is_not_truncated() -> None:
    assert g.focal_length_px(1280, 90.9) != pytest.approx(g.focal_length_px(1280, 90.0))


def test_intrinsics_are_square_pixels_about_the_middle() -> None:
    np.testing.assert_allclose(K, [[640, 0, 640], [0, 640, 360], [0, 0, 1]], atol=1e-12)
    assert g.vertical_fov_deg(1280, 720, 90.0) == pytest.approx(58.7155, abs=1e-4)


@pytest.mark.parametrize(("width", "fov_deg"), [(0, 90.0), (640, 0.0), (640, 180.0)])
def test_impossible_cameras_are_refused(width: int, fov_deg: float) -> None:
    with pytest.raises(BadInputError, match="no projection"):
        g.focal_length_px(width, fov_deg)


def test_a_world_point_projects_to_the_golden_pixel() -> None:
    optical = g.transform_points(g.optical_from_world(np.eye(4)), [[20.0, 5.0, 2.0]])
    np.testing.assert_allclose(optical, [[5.0, -2.0, 20.0]], atol=1e-12)
    np.testing.assert_allclose(g.project(optical, K), [[800.0, 296.0]], atol=1e-9)


@pytest.mark.parametrize("z", [0.0999, 0.0, -20.0])
def test_points_nearer_than_the_near_plane_yield_no_pixel(z: float) -> None:
    assert np.isnan(g.project([[1.0, 1.0, z]], K)).all()


def test_back_projection_inverts_projection() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform([-20, -20, 1], [20, 20, 60], (100, 3))
    back = g.back_project(g.project(points, K), points[:, 2], K)
    np.testing.assert_allclose(back, points, atol=1e-10)


def test_range_of_a_plane_grows_towards_the_corner_of_the_image() -> None:
    factor = g.range_per_depth(1280, 720, 90.0)
    assert factor.shape == (720, 1280)
    x, y = (0.5 - 640) / 640, (0.5 - 360) / 640
    assert factor[0, 0] == pytest.approx(np.sqrt(1 + x * x + y * y), abs=1e-12)
    assert 10.0 * factor[359, 639] == pytest.approx(10.0, abs=1e-5)
    np.testing.assert_allclose(factor, factor[::-1, ::-1], atol=1e-12)


def box_in_camera(camera_deg: list[float], object_deg: list[float]) -> np.ndarray:
    return g.OPTICAL_FROM_SENSOR @ g.rotation_matrix(camera_deg).T @ g.rotation_matrix(object_deg)


@pytest.mark.parametrize(
    ("yaw_deg", "expected"), [(0, -np.pi / 2), (90, 0), (180, np.pi / 2), (-90, -np.pi)]
)
def test_rotation_y_of_relative_yaw(yaw_deg: float, expected: float) -> None:
    heading = float(g.rotation_y(box_in_camera([0, 0, 0], [0, yaw_deg, 0])))
    assert heading == pytest.approx(expected, abs=1e-12)
    assert -np.pi <= heading < np.pi


def test_rotation_y_equals_the_papers_formula_for_upright_boxes_and_cameras() -> None:
    rng = np.random.default_rng(7)
    yaw_object, yaw_sensor = rng.uniform(-180, 180, (2, 20000))
    zero = np.zeros_like(yaw_object)
    boxes = g.rotation_matrix(np.stack([zero, yaw_object, zero], axis=-1))
    cameras = g.rotation_matrix(np.stack([zero, yaw_sensor, zero], axis=-1))
    general = g.rotation_y(g.OPTICAL_FROM_SENSOR @ np.swapaxes(cameras, 1, 2) @ boxes)
    special = np.radians(yaw_object - yaw_sensor - 90.0)
    np.testing.assert_allclose(g.wrap_angle(general - special), 0.0, atol=1e-12)


def test_rotation_y_of_a_pitched_camera_is_the_general_form() -> None:
    yaw = np.linspace(-180, 180, 14401)
    zero = np.zeros_like(yaw)
    boxes = g.rotation_matrix(np.stack([zero, yaw, zero], axis=-1))
    camera = g.rotation_matrix([-15.0, 0.0, 0.0])
    general = g.rotation_y(g.OPTICAL_FROM_SENSOR @ camera.T @ boxes)
    deviation = g.wrap_angle(general - np.radians(yaw - 90.0))
    assert np.degrees(np.abs(deviation).max()) == pytest.approx(0.993, abs=5e-4)


@pytest.mark.parametrize(
    ("box_deg", "camera_deg", "center_cam", "rotation_y", "alpha"),
    [
        (
            [2.0, 35.0, 1.0],
            [-3.0, 5.0, 0.0],
            (1.625206355, 0.079623474, 14.721917824),
            -1.045686372459,
            -1.155634833807,
        ),
        (
            [0.0, 35.0, 0.0],
            [0.0, 5.0, 0.0],
            (1.625206355, 0.85, 14.697574776),
            -1.047197551197,
            -1.157326648446,
        ),
    ],
    ids=["tilted", "upright"],
)
def test_golden_angles_of_a_box_in_a_camera(
    box_deg: list[float],
    camera_deg: list[float],
    center_cam: tuple[float, float, float],
    rotation_y: float,
    alpha: float,
) -> None:
    camera = g.pose_matrix([0.5, 0.1, 1.6], camera_deg)
    box = g.pose_matrix([15.0, 3.0, 0.75], box_deg)
    found = g.kitti_box(box, [2.3, 0.95, 0.75], camera)
    np.testing.assert_allclose(found.location - [0, 0.75, 0], center_cam, atol=1e-9)
    np.testing.assert_allclose(found.dimensions, [1.5, 1.9, 4.6], atol=1e-12)
    assert found.rotation_y == pytest.approx(rotation_y, abs=1e-12)
    assert found.alpha == pytest.approx(alpha, abs=1e-12)


def test_alpha_is_continuous_behind_the_camera() -> None:
    bearing = np.linspace(-3.0, 3.0, 601)
    centers = 10.0 * np.stack([np.sin(bearing), np.zeros(601), np.cos(bearing)], axis=-1)
    alpha = g.observation_angle(np.zeros(601), centers)
    assert np.abs(np.diff(alpha)).max() < 0.011


@pytest.mark.parametrize(
    ("alpha", "x", "z", "rotation_y"),
    [
        (-1.59, 0.28, 17.74, -1.58),
        (2.13, -11.46, 18.60, 1.58),
        (-1.72, 3.34, 17.73, -1.54),
        (0.15, -3.21, 11.22, -0.13),
        (1.99, -11.33, 26.92, 1.59),
    ],
)
def test_alpha_agrees_with_kittis_own_labels(
    alpha: float, x: float, z: float, rotation_y: float
) -> None:
    found = float(g.observation_angle(rotation_y, [x, 0.0, z]))
    assert found == pytest.approx(alpha, abs=0.01)


def test_a_proper_rotation_has_determinant_one() -> None:
    box = box_in_camera([-3.0, 5.0, 2.0], [2.0, 35.0, 1.0])
    proper = g.proper_box_rotation(box)
    assert np.linalg.det(proper) == pytest.approx(1.0)
    np.testing.assert_allclose(proper @ g.FLU_FROM_CARLA, box, atol=1e-15)
