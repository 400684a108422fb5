"""Golden tests T1-T7: outlines, truncation, 2D boxes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from carstage.annotation.silhouette import (
    Silhouette,
    may_be_in_image,
    pixel_regions,
    silhouette,
    silhouettes,
)
from carstage.geometry import (
    FloatArray,
    box_corners,
    intrinsics,
    optical_from_world,
    pose_matrix,
    transform_points,
)

K = intrinsics(1280, 720, 90.0)
CAR = (2.3, 0.95, 0.75)


def corners(center: Sequence[float], extent: Sequence[float] = CAR, yaw: float = 0) -> FloatArray:
    world = box_corners(pose_matrix(center, [0.0, yaw, 0.0]), extent)
    return transform_points(optical_from_world(np.eye(4)), world)


def outline(
    center: Sequence[float], extent: Sequence[float] = CAR, yaw: float = 0
) -> Silhouette | None:
    found = silhouette(corners(center, extent, yaw), K, 1280, 720)
    # The cheap test must never drop what the exact one keeps.
    if found is not None:
        assert may_be_in_image(corners(center, extent, yaw)[None], K, 1280, 720).all()
    return found


def test_a_box_ahead_is_not_truncated() -> None:
    found = outline((20, 0, 0))
    assert found is not None
    assert found.truncated == 0.0
    golden = (605.649718, 332.881356, 674.350282, 387.118644)
    np.testing.assert_allclose(found.bbox, golden, atol=1e-6)
    assert found.bbox == found.bbox_unclipped
    assert not found.crosses_near


@pytest.mark.parametrize(
    ("center", "extent", "yaw", "truncated"),
    [
        ((20, -20, 0), (0, 1, 1), 0, 0.5),
        ((20, -20, 11.25), (0, 1, 1), 0, 0.75),
        ((20, -20, 0), CAR, 0, 0.590337),
        ((20, -20, 0), CAR, -45, 0.527408),
        ((20, -20, 0), CAR, 45, 0.562959),
    ],
    ids=["half a plate", "three quarters of a plate", "car", "car away", "car across"],
)
def test_truncation_is_the_share_of_area_outside(
    center: Sequence[float], extent: Sequence[float], yaw: float, truncated: float
) -> None:
    found = outline(center, extent, yaw)
    assert found is not None
    assert found.truncated == pytest.approx(truncated, abs=1e-6)


def test_a_box_that_crosses_the_near_plane_stays_finite_and_upright() -> None:
    optical = corners((1.5, 3, 0))
    assert np.count_nonzero(optical[:, 2] < 0.1) == 4
    found = outline((1.5, 3, 0))
    assert found is not None
    assert found.crosses_near
    assert found.truncated == pytest.approx(0.999409, abs=1e-6)
    for x0, y0, x1, y1 in (found.bbox, found.bbox_unclipped):
        assert np.isfinite([x0, y0, x1, y1]).all()
        assert x0 < x1
        assert y0 < y1
    assert found.bbox[0] >= 640.0


def test_a_box_behind_the_camera_has_no_outline() -> None:
    assert outline((-20, 0, 0)) is None


def test_a_box_beside_the_image_has_no_outline() -> None:
    assert outline((20, 40, 0)) is None


def test_boxes_beyond_one_side_are_excluded_cheaply() -> None:
    hidden = [corners(center) for center in ((-20, 0, 0), (20, 40, 0), (20, -40, 0), (20, 0, 40))]
    assert not may_be_in_image(np.stack(hidden), K, 1280, 720).any()


def test_the_cheap_test_never_drops_what_the_exact_one_keeps() -> None:
    rng = np.random.default_rng(21)
    kept = 0
    for _ in range(400):
        found = outline(rng.uniform(-25, 25, 3), rng.uniform(0.3, 5, 3), rng.uniform(-180, 180))
        kept += found is not None
    assert kept > 50


def test_many_outlines_at_once_are_those_of_each_box() -> None:
    rng = np.random.default_rng(22)
    boxes = np.stack(
        [
            corners(rng.uniform(-10, 60, 3) * (1, 1, 0.1), rng.uniform(0.3, 3, 3), yaw)
            for yaw in rng.uniform(-180, 180, 300)
        ]
    )
    together = silhouettes(boxes, K, 1280, 720)
    assert together == [silhouette(box, K, 1280, 720) for box in boxes]
    whole = [found is not None and found.truncated == 0.0 for found in together]
    assert 20 < sum(whole) < 280
    for found, (x0, y0, x1, y1) in zip(together, pixel_regions(boxes, K, 1280, 720), strict=True):
        if found is not None:
            assert 0 <= x0 <= found.bbox[0]
            assert 0 <= y0 <= found.bbox[1]
            assert found.bbox[2] <= x1 <= 1280
            assert found.bbox[3] <= y1 <= 720
