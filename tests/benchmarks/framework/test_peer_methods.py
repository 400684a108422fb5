"""The two other tools' rules, each on a scene that is made up for it."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.framework.peer_methods import PeerObject, class_pixels, depth_patch
from carstage.geometry import intrinsics, optical_from_world, pose_matrix

WIDTH, HEIGHT = 200, 100
K = intrinsics(WIDTH, HEIGHT, 90.0)  # 100 px of focal length
OPTICAL = optical_from_world(np.eye(4))


def thing(
    x_m: float, y_m: float = 0.0, half_m: float = 1.0, *, is_walker: bool = False
) -> PeerObject:
    """A cube around the camera's height."""
    place = np.array([x_m, y_m, 0.0])
    pose = pose_matrix(place, np.zeros(3))
    extent = np.full(3, half_m)
    return PeerObject.of(OPTICAL, pose, extent, place, is_walker=is_walker)


def depth(value_m: float) -> np.ndarray:
    return np.full((HEIGHT, WIDTH), value_m, np.float32)


def test_what_stands_free_is_visible_to_the_depth_patch_and_what_a_wall_hides_is_not() -> None:
    one = thing(20.0)
    assert depth_patch(one, K, depth(19.0)).visible
    assert not depth_patch(one, K, depth(15.0)).visible
    # Nearer by less than the half diagonal, 1.41 m.
    assert depth_patch(one, K, depth(18.7)).visible


def test_half_of_the_rows_are_fewer_than_half_of_the_pixels() -> None:
    # The rectangle is 10.5 px wide and high, so the patch is 4 x 4: 2 rows' worth are 2 pixels.
    one, image = thing(20.0), depth(5.0)
    image[48:52, 98] = 19.0
    assert depth_patch(one, K, image).visible
    assert not depth_patch(one, K, image, as_described=True).visible


@pytest.mark.parametrize(("x_m", "y_m"), [(101.0, 0.0), (10.0, 10.5), (-5.0, 0.0)])
def test_what_is_far_or_beside_the_view_is_not_visible_to_the_depth_patch(
    x_m: float, y_m: float
) -> None:
    assert not depth_patch(thing(x_m, y_m), K, depth(1000.0)).visible


def test_the_box_of_the_depth_patch_is_that_of_all_vertices() -> None:
    box = depth_patch(thing(11.0), K, depth(10.0)).box
    assert box == pytest.approx((90.0, 40.0, 110.0, 60.0))


def masks(*boxes: tuple[int, int, int, int]) -> np.ndarray:
    found = np.zeros((HEIGHT, WIDTH), np.bool_)
    for x0, y0, x1, y1 in boxes:
        found[y0:y1, x0:x1] = True
    return found


def rounded(box: tuple[int, int, int, int]) -> np.ndarray:
    """A rectangle without two of its corners, as no vehicle fills its rectangle."""
    x0, y0, x1, y1 = box
    return masks(box) & ~masks((x0, y0, x0 + 2, y0 + 2), (x1 - 2, y1 - 2, x1, y1))


NOTHING = masks()


def test_a_rectangle_is_made_tight_around_the_pixels_of_its_class() -> None:
    car = rounded((92, 42, 107, 57))
    (found,) = class_pixels([thing(11.0)], K, car, NOTHING)
    assert found.visible
    assert found.box == (92.0, 42.0, 107.0, 57.0)


def test_without_a_pixel_of_its_class_an_object_is_hidden() -> None:
    (found,) = class_pixels([thing(11.0)], K, NOTHING, masks((90, 40, 110, 60)))
    assert not found.visible


def test_whose_corners_are_all_of_the_class_is_taken_for_a_piece_of_something_larger() -> None:
    (found,) = class_pixels([thing(11.0)], K, masks((60, 20, 140, 80)), NOTHING)
    assert not found.visible


def test_a_vehicle_within_the_rectangle_of_another_is_hidden_a_pedestrian_is_not() -> None:
    near, far, person = thing(5.0), thing(20.0), thing(20.0, half_m=0.8, is_walker=True)
    lorry, walker = rounded((76, 26, 124, 74)), rounded((96, 45, 104, 55))
    found = class_pixels([near, far, person], K, lorry & ~walker, walker, any_size=True)
    assert [one.visible for one in found] == [True, False, True]


def test_small_boxes_are_left_out_unless_any_size_counts() -> None:
    car = rounded((96, 46, 104, 54))
    assert [one.visible for one in class_pixels([thing(20.0)], K, car, NOTHING)] == [False]
    assert [one.visible for one in class_pixels([thing(20.0)], K, car, NOTHING, any_size=True)] == [
        True
    ]


def test_an_object_that_reaches_behind_the_camera_is_left_out() -> None:
    (found,) = class_pixels([thing(0.5)], K, masks((0, 0, WIDTH, HEIGHT)), NOTHING)
    assert not found.visible
