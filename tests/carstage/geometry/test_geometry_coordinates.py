"""Golden tests G1-G3 and D10: rotations, axis changes, quaternions, angular velocity."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from carstage import geometry as g

Array = NDArray[np.float64]


def elementary(axis: int, angle_rad: float) -> Array:
    """The textbook rotation matrix about x, y or z."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def random_rotations(count: int, seed: int = 3) -> Array:
    rng = np.random.default_rng(seed)
    return rng.uniform([-89.0, -180.0, -180.0], [89.0, 180.0, 180.0], (count, 3))


def test_rotation_matrix_has_the_golden_values() -> None:
    matrix = g.rotation_matrix([10.0, 20.0, 30.0])
    golden = [
        [0.925416578, -0.214610177, -0.312324556],
        [0.336824089, 0.843493269, 0.418412044],
        [0.173648178, -0.492403877, 0.852868532],
    ]
    np.testing.assert_allclose(matrix, golden, atol=1e-9)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(matrix) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(g.rotation_deg(matrix), [10.0, 20.0, 30.0], atol=1e-12)


def test_rotation_is_yaw_after_negative_pitch_after_negative_roll() -> None:
    angles = random_rotations(2000)
    matrices = g.rotation_matrix(angles)
    for (pitch, yaw, roll), matrix in zip(np.radians(angles), matrices, strict=True):
        expected = elementary(2, yaw) @ elementary(1, -pitch) @ elementary(0, -roll)
        np.testing.assert_allclose(matrix, expected, atol=1e-12)
        extrinsic_xyz = elementary(2, -yaw) @ elementary(1, -pitch) @ elementary(0, roll)
        np.testing.assert_allclose(g.flu_rotation(matrix), extrinsic_xyz, atol=1e-12)


def test_rotation_angles_come_back_from_the_matrix() -> None:
    angles = random_rotations(500)
    np.testing.assert_allclose(g.rotation_deg(g.rotation_matrix(angles)), angles, atol=1e-9)


@pytest.mark.parametrize(
    "matrix", [g.OPTICAL_FROM_SENSOR, g.FLU_FROM_CARLA, g.NUSCENES_LIDAR_FROM_SENSOR]
)
def test_axis_matrices_change_handedness(matrix: Array) -> None:
    assert np.linalg.det(matrix) == pytest.approx(-1.0)
    np.testing.assert_array_equal(matrix @ matrix.T, np.eye(3))
    with pytest.raises(ValueError, match="read-only"):
        matrix[0, 0] = 2.0


def test_quaternions_have_the_golden_values() -> None:
    flu_from_optical = g.FLU_FROM_CARLA @ g.OPTICAL_FROM_SENSOR.T
    np.testing.assert_allclose(
        g.quaternion_from_matrix(flu_from_optical), [0.5, -0.5, 0.5, -0.5], atol=1e-12
    )
    yaw = g.quaternion_from_matrix(g.flu_rotation(g.rotation_matrix([0.0, 30.0, 0.0])))
    np.testing.assert_allclose(yaw, [0.965925826, 0.0, 0.0, -0.258819045], atol=1e-9)
    general = g.quaternion_from_matrix(g.flu_rotation(g.rotation_matrix([10.0, 20.0, 30.0])))
    golden = [0.951548525, 0.239298338, -0.127679441, -0.144878125]
    np.testing.assert_allclose(general, golden, atol=1e-9)


def test_quaternions_return_the_rotation_also_near_half_turns() -> None:
    angles = np.concatenate([random_rotations(500), [[0, 180, 0], [0, 0, 180], [0, 180, 180]]])
    matrices = g.rotation_matrix(angles)
    quaternions = g.quaternion_from_matrix(matrices)
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=-1), 1.0, atol=1e-14)
    assert (quaternions[:, 0] >= 0.0).all()
    np.testing.assert_allclose(g.matrix_from_quaternion(quaternions), matrices, atol=1e-12)


def test_pose_inverse_undoes_the_pose() -> None:
    rng = np.random.default_rng(5)
    poses = g.pose_matrix(rng.uniform(-300, 300, (50, 3)), random_rotations(50))
    np.testing.assert_allclose(
        poses @ g.invert_pose(poses), np.broadcast_to(np.eye(4), (50, 4, 4)), atol=1e-12
    )
    points = rng.uniform(-50, 50, (20, 3))
    there = g.transform_points(poses[0], points)
    np.testing.assert_allclose(
        g.transform_points(g.invert_pose(poses[0]), there), points, atol=1e-12
    )


@given(st.floats(-1e4, 1e4, allow_nan=False))
def test_wrapped_angles_lie_in_the_half_open_interval(angle: float) -> None:
    wrapped = float(g.wrap_angle(angle))
    assert -np.pi <= wrapped < np.pi
    turns = (wrapped - angle) / (2 * np.pi)
    assert turns == pytest.approx(round(turns), abs=1e-9)


def test_wrapping_sends_pi_to_minus_pi() -> None:
    np.testing.assert_allclose(g.wrap_angle([np.pi, -np.pi, 3 * np.pi]), [-np.pi] * 3)
    assert float(g.wrap_angle(-np.pi - 1e-17)) == -np.pi


@pytest.mark.parametrize(
    ("axis", "rates_deg_s"),
    [(0, (0.0, 0.0, -1.0)), (1, (-1.0, 0.0, 0.0)), (2, (0.0, 1.0, 0.0))],
)
def test_angular_velocity_signs_follow_from_the_rotation(
    axis: int, rates_deg_s: tuple[float, float, float]
) -> None:
    """+x is -roll rate, +y is -pitch rate, +z is yaw rate: v = w x r, componentwise."""
    dt_s = 1e-4
    rates = np.degrees(np.array(rates_deg_s))
    change = (g.rotation_matrix(rates * dt_s) - g.rotation_matrix(-rates * dt_s)) / (2 * dt_s)
    w = np.zeros(3)
    w[axis] = 1.0
    cross = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    np.testing.assert_allclose(change, cross, atol=1e-6)


def test_angular_velocity_changes_axes_as_a_pseudovector() -> None:
    """The spin of S R S, computed from the matrices, is det(S) S w."""
    w = np.array([0.3, -0.2, 0.5])
    cross = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    spin = g.flu_rotation(cross)
    expected = [spin[2, 1], spin[0, 2], spin[1, 0]]
    np.testing.assert_allclose(g.flu_angular_velocity(w), expected, atol=1e-15)
    clockwise = g.flu_angular_velocity([0.0, 0.0, 1.0])
    assert clockwise[2] < 0.0
    np.testing.assert_array_equal(g.flu_vector([1.0, 2.0, 3.0]), [1.0, -2.0, 3.0])
