"""Outlines of patches in pictures, and how much of them nothing stands before."""

from __future__ import annotations

import numpy as np
import pytest

from carstage.annotation.patches import PatchView, faces_of, patch_in_view
from carstage.geometry import FloatArray, intrinsics, rotation_matrix

WIDTH, HEIGHT = 200, 100
K = intrinsics(WIDTH, HEIGHT, 90.0)


def view(depth_m: float = 10.0, range_m: float = 80.0) -> PatchView:
    image = np.full((HEIGHT, WIDTH), depth_m, np.float32)
    return PatchView(K, np.eye(4), image, range_m)


def square(x: float = 10.0, y: float = 0.0, half: float = 1.0) -> FloatArray:
    """Facing the camera at the origin, which looks along +x with +y to the right."""
    return np.array(
        [[x, y - half, half], [x, y + half, half], [x, y + half, -half], [x, y - half, -half]]
    )


def test_a_patch_ahead_is_a_square_in_the_middle() -> None:
    found = patch_in_view(square(), view())
    assert found is not None
    assert sorted(zip(found["u"], found["v"], strict=True)) == [
        (90.0, 40.0), (90.0, 60.0), (110.0, 40.0), (110.0, 60.0),
    ]  # fmt: skip
    assert (found["pixels"], found["visible_share"]) == (400, 1.0)
    assert (found["distance"], found["facing"]) == (10.0, 1.0)


def test_its_back_is_not_seen() -> None:
    assert patch_in_view(square()[[1, 0, 3, 2]], view()) is None
    assert patch_in_view(square(-10.0), view()) is None


def test_what_stands_before_it_hides_it() -> None:
    one = view()
    one.depth_m[:, 100:] = 5.0
    found = patch_in_view(square(), one)
    assert found is not None
    assert (found["pixels"], found["visible_share"]) == (400, 0.5)


def test_what_is_farther_or_out_of_the_picture_has_no_row() -> None:
    assert patch_in_view(square(), view(range_m=9.0)) is None
    assert patch_in_view(square(y=12.0), view()) is None


def test_it_is_cut_at_the_pictures_edge() -> None:
    found = patch_in_view(square(y=10.0), view())
    assert found is not None
    assert max(found["u"]) == WIDTH
    assert found["pixels"] == 200


def test_a_patch_that_reaches_behind_the_camera_is_cut_before_it() -> None:
    corners = np.array([[-2.0, 1, 0.5], [9.0, 1, 0.5], [9.0, 1, -0.5], [-2.0, 1, -0.5]])
    found = patch_in_view(corners[[1, 0, 3, 2]], view())
    if found is None:
        found = patch_in_view(corners, view())
    assert found is not None
    assert np.isfinite(found["u"] + found["v"]).all()
    assert found["pixels"] > 0


def test_slanted_patches_are_seen_where_their_own_depth_is() -> None:
    turn = rotation_matrix((0.0, 40.0, 0.0))
    corners, _ = faces_of((square(0.0), square(0.0)), turn, np.array([10.0, 0.0, 0.0]))
    blank = patch_in_view(corners, view(50.0))
    assert blank is not None
    assert blank["visible_share"] == 0.0
    assert blank["facing"] == pytest.approx(np.cos(np.radians(40.0)), abs=1e-3)
    one = view()
    u = (np.arange(WIDTH) + 0.5 - WIDTH / 2) / K[0, 0]
    normal = turn @ np.array([1.0, 0.0, 0.0])
    one.depth_m[:] = (10.0 * normal[0] / (normal[0] + normal[1] * u)).astype(np.float32)
    seen = patch_in_view(corners, one)
    assert seen is not None
    assert seen["visible_share"] == 1.0
