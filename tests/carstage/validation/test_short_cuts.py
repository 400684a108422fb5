"""What the checks compute by a short cut is what the long way gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from carstage.annotation.rle import encode_mask
from carstage.dataset.calibration import SensorCalibration
from carstage.dataset.masks import decode_mask, mask_pixels
from carstage.geometry import (
    OPTICAL_FROM_SENSOR,
    Z_NEAR_M,
    back_project,
    clip_polygon_to_image,
    convex_hull,
    invert_pose,
    polygon_area,
    pose_matrix,
    transform_points,
)
from carstage.validation.checks.completeness import MIN_AREA_PX, perhaps_in_view
from carstage.validation.checks.labels import LabelledBox
from carstage.validation.checks.ranging import (
    ABSOLUTE_TOLERANCE_M,
    EDGE_BEND,
    PARALLAX_PX,
    RELATIVE_TOLERANCE,
    RangingFigures,
    compare_with_depth,
)
from carstage.validation.checks.recomputing import numbers
from carstage.validation.checks.silhouettes import distance_outside, outside_hull, projected_hulls

WIDTH, HEIGHT = 48, 32


def sensor(name: str, location: tuple[float, float, float], *, yaw_deg: float) -> SensorCalibration:
    focal = WIDTH / 2.0
    return SensorCalibration(
        id=name, kind="depth", blueprint="", attributes={}, attach_to="ego", attachment="rigid",
        carrier_from_sensor=np.eye(4), ego_from_sensor=pose_matrix(location, (3.0, yaw_deg, -2.0)),
        codec="png", labelled=True, depth=None, instance=None, width=WIDTH, height=HEIGHT,
        fov_deg=90.0,
        k=np.array([[focal, 0.0, WIDTH / 2], [0.0, focal, HEIGHT / 2], [0.0, 0.0, 1.0]]),
    )  # fmt: skip


@settings(deadline=None)  # the first call loads compiled code
@given(mask=arrays.arrays(np.bool_, arrays.array_shapes(min_dims=2, max_dims=2, max_side=12)))
def test_pixels_of_a_mask_are_those_of_its_image(mask: np.ndarray) -> None:
    height, width = mask.shape
    counts = encode_mask(mask, 0, 0, width, height)
    again = np.zeros_like(mask)
    rows, columns = mask_pixels(counts, height, width)
    again[rows, columns] = True
    np.testing.assert_array_equal(again, decode_mask(counts, height, width))
    assert len(rows) == mask.sum()


@pytest.mark.parametrize(
    ("kind", "values", "shape"),
    [
        (pa.float64(), [1.5, None, -2.0], ()),
        (pa.int32(), [1, 2, None], ()),
        (pa.bool_(), [True, None, False], ()),
        (pa.list_(pa.float64(), 3), [[1.0, 2.0, 3.0], None, [4.0, 5.0, 6.0]], (3,)),
        (pa.list_(pa.float32()), [None, None], (3,)),
        (pa.list_(pa.float64()), [[1.0, None, 3.0]], (3,)),
        (pa.list_(pa.list_(pa.float64(), 2), 2), [[[1.0, 2.0], [3.0, 4.0]], None], (2, 2)),
        (pa.float64(), [], ()),
    ],
)
def test_numbers_of_a_column_are_its_values(
    kind: pa.DataType, values: list[Any], shape: tuple[int, ...]
) -> None:
    column = pa.chunked_array([pa.array(values[:1], kind), pa.array(values[1:], kind)])
    found = numbers(pa.table({"c": column}), "c", *shape)
    wanted = [np.full(shape, np.nan) if v is None else np.array(v, np.float64) for v in values]
    np.testing.assert_array_equal(found, np.array(wanted).reshape(len(values), *shape))


def test_lists_of_another_length_are_no_numbers_of_that_shape() -> None:
    table = pa.table({"c": pa.array([[1.0, 2.0], [3.0, 4.0, 5.0, 6.0]], pa.list_(pa.float64()))})
    with pytest.raises(ValueError, match="shape"):
        numbers(table, "c", 3)


@settings(deadline=None)
@given(
    place=st.tuples(*[st.floats(-30.0, 30.0)] * 3),
    turned=st.tuples(*[st.floats(-180.0, 180.0)] * 3),
    extent=st.tuples(*[st.floats(0.05, 6.0)] * 3),
)
def test_no_box_that_a_camera_can_see_is_passed_over(
    place: tuple[float, float, float],
    turned: tuple[float, float, float],
    extent: tuple[float, float, float],
) -> None:
    camera = sensor("CAM", (1.0, 0.2, 1.5), yaw_deg=20.0)
    box = LabelledBox(1, pose_matrix(place, turned), np.array(extent), frozenset(), {}, False)
    (hull,) = projected_hulls(camera, [box])
    seen = len(hull) >= 3 and (
        polygon_area(clip_polygon_to_image(hull, WIDTH, HEIGHT)) >= MIN_AREA_PX
    )
    if seen:
        assert perhaps_in_view(camera, [box]) == [box]


@given(
    mask=arrays.arrays(np.bool_, (12, 16)),
    places=st.lists(st.tuples(st.floats(0, 16), st.floats(0, 12)), min_size=3, max_size=8),
    by_columns=st.booleans(),
)
def test_pixels_whose_line_ends_are_inside_are_all_inside(
    mask: np.ndarray, places: list[tuple[float, float]], by_columns: bool
) -> None:
    hull = convex_hull(np.array(places))
    assume(len(hull) >= 3)
    v, u = np.nonzero(mask.T)[::-1] if by_columns else np.nonzero(mask)
    plain = distance_outside(hull, np.column_stack([u + 0.5, v + 0.5]))
    camera = sensor("CAM", (0.0, 0.0, 1.5), yaw_deg=0.0)
    np.testing.assert_array_equal(outside_hull(camera, hull, (v, u)), plain)


def test_boxes_behind_and_beside_a_camera_are_passed_over() -> None:
    camera = sensor("CAM", (0.0, 0.0, 1.5), yaw_deg=0.0)
    boxes = [
        LabelledBox(track, pose_matrix(place, (0.0, 0.0, 0.0)), np.ones(3), frozenset(), {}, False)
        for track, place in enumerate([(-20.0, 0.0, 1.0), (2.0, 30.0, 1.0), (20.0, 0.0, 1.0)])
    ]
    assert perhaps_in_view(camera, boxes) == boxes[2:]
    assert perhaps_in_view(camera, []) == []


def plainly_compared(
    points: np.ndarray, lidar: SensorCalibration, depth_m: np.ndarray, camera: SensorCalibration
) -> RangingFigures:
    """``compare_with_depth`` as its description has it, everything computed of every point."""
    lidar_from_camera = invert_pose(lidar.ego_from_sensor) @ camera.ego_from_sensor
    optical = transform_points(invert_pose(lidar_from_camera), points) @ OPTICAL_FROM_SENSOR.T
    found = RangingFigures()
    for xyz, (x, y, z) in zip(points, optical, strict=True):
        if z < Z_NEAR_M:
            continue
        u, v = camera.k[0, 0] * x / z + camera.k[0, 2], camera.k[1, 1] * y / z + camera.k[1, 2]
        if not (1 <= u < WIDTH - 1 and 1 <= v < HEIGHT - 1):
            continue
        found.in_view += 1
        row, column = int(v), int(u)
        allowed = ABSOLUTE_TOLERANCE_M + RELATIVE_TOLERANCE * z
        around = depth_m[row - 1 : row + 2, column - 1 : column + 2].astype(np.float64)
        top, left = int(np.floor(v - 0.5)), int(np.floor(u - 0.5))
        fx, fy = u - 0.5 - left, v - 0.5 - top
        square = 1.0 / depth_m[top : top + 2, left : left + 2].astype(np.float64)
        between = (1 - fy, fy) @ square @ (1 - fx, fx)
        if abs(1.0 / between - z) < allowed or (np.abs(around - z) < allowed).any():
            found.agreeing += 1
            found.comparable += 1
            continue
        inverse = (1.0 / around).ravel()
        bends = np.abs(inverse[:4] + inverse[:4:-1] - 2.0 * inverse[4]) / inverse[4]
        if bends.max() > EDGE_BEND and around.min() - allowed < z < around.max() + allowed:
            continue
        lifted = back_project(np.array([[u, v]]), around[1, 1:2], camera.k) @ OPTICAL_FROM_SENSOR
        surface = transform_points(lidar_from_camera, lifted)[0]
        apart = np.arctan2(np.linalg.norm(np.cross(surface, xyz)), surface @ xyz)
        if not (around[1, 1] < z and apart > PARALLAX_PX / camera.k[0, 0]):
            found.comparable += 1
    return found


@pytest.mark.parametrize("seed", range(4))
def test_points_compare_with_depth_as_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lidar = sensor("LIDAR", (0.0, 0.0, 2.0), yaw_deg=0.0)
    camera = sensor("DEPTH", (1.5, 0.3, 1.4), yaw_deg=10.0)
    depth_m = np.full((HEIGHT, WIDTH), 12.0, np.float32)
    depth_m[:, 20:] = 20.0
    depth_m[10:18, 5:14] = 6.0
    depth_m += rng.normal(0.0, 0.05, depth_m.shape).astype(np.float32)
    directions = rng.normal((2.0, 0.0, 0.0), 1.0, (3000, 3))
    ranges = rng.choice([5.0, 6.5, 12.0, 16.0, 20.0], (3000, 1)) + rng.normal(0.0, 0.3, (3000, 1))
    points = ranges * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    found = compare_with_depth(points, lidar, depth_m, camera)
    assert found == plainly_compared(points, lidar, depth_m, camera)
    assert 0 < found.agreeing < found.comparable < found.in_view


def test_what_is_not_a_number_agrees_with_nothing() -> None:
    lidar = sensor("LIDAR", (0.0, 0.0, 2.0), yaw_deg=0.0)
    depth_m = np.full((HEIGHT, WIDTH), np.nan, np.float32)
    found = compare_with_depth(np.array([[10.0, 0.0, 0.0]]), lidar, depth_m, lidar)
    assert (found.in_view, found.agreeing) == (1, 0)
