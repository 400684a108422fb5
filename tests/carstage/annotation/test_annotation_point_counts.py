"""Points in boxes: the grid counts what a test of every point counts."""

from __future__ import annotations

import numpy as np
import pytest

from carstage.annotation.point_counts import count_points
from carstage.geometry import invert_pose, pose_matrix, transform_points


def brute_force(points: np.ndarray, poses: np.ndarray, extents: np.ndarray) -> list[int]:
    found = []
    for pose, extent in zip(poses, extents, strict=True):
        local = transform_points(invert_pose(pose), points[:, :3].astype(np.float64))
        found.append(int((np.abs(local) <= extent + 1e-6).all(axis=1).sum()))
    return found


@pytest.mark.parametrize("spread_m", [1e-4, 3.0, 100.0])
def test_counts_equal_those_of_testing_every_point(spread_m: float) -> None:
    rng = np.random.default_rng(4)
    points = rng.normal(0.0, spread_m, (20000, 4)).astype(np.float32)
    poses = pose_matrix(
        rng.normal(0.0, spread_m, (40, 3)), rng.uniform(-180, 180, (40, 3)) * [0.1, 1, 0.1]
    )
    extents = rng.uniform(0.2, 8.0, (40, 3))
    counts = count_points(points, poses, extents).tolist()
    assert counts == brute_force(points, poses, extents)
    assert max(counts) > 0


def test_points_on_a_face_count_and_points_beyond_do_not() -> None:
    points = np.array([[2.0, 0, 0, 1], [2.001, 0, 0, 1], [0, -1, 0, 1]], dtype=np.float32)
    pose = pose_matrix([[0, 0, 0]], [[0, 0, 0]])
    assert count_points(points, pose, np.array([[2.0, 1.0, 1.0]])).tolist() == [2]


def test_an_empty_sweep_counts_nothing() -> None:
    pose = pose_matrix([[0, 0, 0]], [[0, 0, 0]])
    nothing = np.zeros((0, 4), dtype=np.float32)
    assert count_points(nothing, pose, np.ones((1, 3))).tolist() == [0]
    assert count_points(nothing, np.zeros((0, 4, 4)), np.ones((0, 3))).tolist() == []
