"""Motion over a sweep, against poses in between that are interpolated another way."""

from __future__ import annotations

import numpy as np
import pytest

from carstage.geometry import invert_pose, pose_matrix, transform_points
from carstage.geometry.sweep_motion import SweepMotion

SPAN_S = 0.1
BEFORE = pose_matrix([10.0, -4.0, 1.8], [1.0, 170.0, -0.5])
NOW = pose_matrix([8.2, -3.5, 1.9], [1.5, 176.0, 0.5])


def test_points_of_both_ends_are_carried_from_pose_to_pose() -> None:
    motion = SweepMotion.between(BEFORE, NOW, SPAN_S)
    points = np.random.default_rng(1).normal(0, 30, (200, 3))
    expected = transform_points(invert_pose(NOW) @ BEFORE, points)
    np.testing.assert_allclose(motion.undone(points, np.full(200, SPAN_S)), expected, atol=1e-9)
    np.testing.assert_allclose(motion.undone(points, np.zeros(200)), points, atol=1e-12)


@pytest.mark.parametrize("part", [0.25, 0.5, 0.8])
def test_in_between_it_is_where_even_angles_put_it(part: float) -> None:
    motion = SweepMotion.between(BEFORE, NOW, SPAN_S)
    there = pose_matrix(
        np.array([8.2, -3.5, 1.9]) - part * np.array([-1.8, 0.5, 0.1]),
        np.array([1.5, 176.0, 0.5]) - part * np.array([0.5, 6.0, 1.0]),
    )
    points = np.random.default_rng(2).normal(0, 30, (200, 3))
    expected = transform_points(invert_pose(NOW) @ there, points)
    found = motion.undone(points, np.full(200, part * SPAN_S))
    # Even angles are no even turn about one axis: 0.0003 rad where all three change.
    off_m = np.linalg.norm(found - expected, axis=1)
    assert (off_m < 0.001 + 3e-4 * np.linalg.norm(points, axis=1)).all()
