"""What is compiled or left out for speed gives the bits that plain numpy gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from carstage.birds_eye import CameraView, Cloud
from carstage.geometry import (
    OPTICAL_FROM_SENSOR,
    Z_NEAR_M,
    intrinsics,
    multiply,
    pose_matrix,
    rotate,
)
from carstage.occupancy import Picture, Sweep, VoxelGrid, grid_from_world, seen_voxels, surface
from carstage.occupancy.gathering import Cells, Gathered
from carstage.occupancy.placing import Placer
from carstage.occupancy.ray_kernel import mark_before

GRID = VoxelGrid((-8.0, -8.0, -1.0), (40, 40, 10), 0.4)
SIDE_M = GRID.side_m / 2


def matrix(rng: np.random.Generator) -> NDArray[np.float64]:
    return grid_from_world(pose_matrix(rng.uniform(-2.0, 2.0, 3), rng.uniform(-15.0, 15.0, 3)))


def picture(rng: np.random.Generator, yaw_deg: float) -> Picture:
    width, height = 60, 40
    depth = rng.uniform(0.0, 14.0, (height, width)).astype(np.float32)
    depth[rng.random((height, width)) < 0.2] = 1000.0
    pose = pose_matrix(rng.uniform(-1.0, 1.0, 3), [rng.uniform(-20, 20), yaw_deg, 5.0])
    tags = rng.integers(0, 20, (height, width), dtype=np.uint8)
    view = CameraView(intrinsics(width, height, 80.0), pose, depth, width, height)
    return Picture(view, tags)


def last_of_cells(points: NDArray[Any]) -> NDArray[np.int64]:
    cells = [tuple(cell) for cell in (points * 2).astype(int).tolist()]
    return np.array(sorted({cell: n for n, cell in enumerate(cells)}.values()), np.int64)


@pytest.mark.parametrize("yaw_deg", [0.0, 75.0, 180.0, -100.0])
def test_a_picture_s_surface_is_the_last_pixel_of_each_cell(yaw_deg: float) -> None:
    rng = np.random.default_rng(int(yaw_deg) % 97)
    grid_matrix, seen = matrix(rng), picture(rng, yaw_deg)
    view, tags = seen.view, seen.tags
    assert view.depth_m is not None
    assert tags is not None
    units = GRID.units_from(multiply(grid_matrix, view.world_from_sensor))
    optical = multiply(units[:, :3], OPTICAL_FROM_SENSOR.T).astype(np.float32)
    start = units[:, 3].astype(np.float32)
    u, v = (
        ((np.arange(size) + 0.5 - view.k[axis, 2]) / view.k[axis, axis]).astype(np.float32)
        for axis, size in ((0, view.width), (1, view.height))
    )
    parts = []
    for axis in range(3):
        across, down, along = optical[axis]
        rays = (across * u)[None, :] + (down * v + along)[:, None]
        parts.append(rays * view.depth_m + start[axis])
    places = np.stack(parts, axis=-1).reshape(-1, 3)
    inside = GRID.holds(places) & (view.depth_m.ravel() > Z_NEAR_M)
    expected = places[inside]
    kept = last_of_cells(expected)
    found = surface(GRID, grid_matrix, seen)
    assert len(kept) > 5
    assert np.array_equal(found.points, expected[kept].astype(np.float64))
    assert found.tags is not None
    assert np.array_equal(found.tags, tags.ravel()[inside][kept])


def test_a_sweep_s_ends_keep_their_order_within_and_beyond() -> None:
    rng = np.random.default_rng(5)
    grid_matrix, pose = matrix(rng), pose_matrix([0.5, 1.0, 1.5], [3.0, 40.0, 1.0])
    points = rng.uniform(-14.0, 14.0, (4000, 3)) * [1.0, 1.0, 0.2]
    tags = rng.integers(0, 20, len(points), dtype=np.uint8)
    x, y, z = points.T
    units = GRID.units_from(multiply(grid_matrix, pose))
    places = np.stack([r[0] * x + r[1] * y + r[2] * z + r[3] for r in units], axis=-1)
    inside = GRID.holds(places)
    kept = last_of_cells(places[inside])
    found = surface(GRID, grid_matrix, Sweep(Cloud(pose, points), tags))
    assert np.array_equal(found.points, places[inside][kept])
    assert np.array_equal(found.beyond, places[~inside])
    assert found.tags is not None
    assert np.array_equal(found.tags, tags[inside][kept])


@pytest.mark.parametrize("yaw_deg", [0.0, 75.0, 180.0, -100.0])
def test_what_pixels_show_is_the_same_by_their_surface_and_without(yaw_deg: float) -> None:
    rng = np.random.default_rng(int(yaw_deg) % 89)
    grid_matrix, seen = matrix(rng), picture(rng, yaw_deg)
    by_surface = seen_voxels(GRID, grid_matrix, [seen], [surface(GRID, grid_matrix, seen)])
    assert by_surface.any()
    assert np.array_equal(by_surface, seen_voxels(GRID, grid_matrix, [seen], [None]))


@pytest.mark.parametrize("centre", [30.0, -4.0, 70.0])
@pytest.mark.parametrize("yaw_deg", [0.0, 30.0, 100.0, 180.0, -60.0])
def test_no_voxel_of_a_picture_is_left_out_with_its_column(yaw_deg: float, centre: float) -> None:
    """Columns beside the picture are passed over; a principal point beside it changes nothing."""
    rng = np.random.default_rng(int(yaw_deg) % 83)
    view = picture(rng, yaw_deg).view
    assert view.depth_m is not None
    k = view.k.astype(np.float32)
    k[0, 2] = centre
    units = GRID.units_from(multiply(matrix(rng), view.world_from_sensor))
    optical = multiply(OPTICAL_FROM_SENSOR, units[:, :3].T) * (GRID.side_m * GRID.side_m)
    begin = -rotate(optical, units[:, 3])
    steps = [
        np.stack([((np.arange(count) + 0.5) * row[axis]).astype(np.float32) for row in optical])
        for axis, count in enumerate(GRID.shape)
    ]
    steps[1] += begin.astype(np.float32)[:, None]
    found = np.zeros(GRID.shape, np.bool_)
    mark_before(*steps, k, view.depth_m, np.float32(Z_NEAR_M), found)
    right, down, ahead = (
        (a[:, None] + b[None, :])[:, :, None] + c[None, None, :]
        for a, b, c in zip(*steps, strict=True)
    )
    right, down = right * k[0, 0], down * k[1, 1]
    width, height = np.float32(view.width), np.float32(view.height)
    inside = (ahead > np.float32(Z_NEAR_M)) & (right >= -k[0, 2] * ahead)
    inside &= (right < (width - k[0, 2]) * ahead) & (down >= -k[1, 2] * ahead)
    inside &= down < (height - k[1, 2]) * ahead
    column = np.minimum((right[inside] / ahead[inside] + k[0, 2]).astype(int), view.width - 1)
    row = np.minimum((down[inside] / ahead[inside] + k[1, 2]).astype(int), view.height - 1)
    expected = np.zeros(GRID.shape, np.bool_)
    expected[inside] = ahead[inside] <= view.depth_m[row, column]
    assert np.array_equal(found, expected)


def test_cells_add_up_to_the_same_whatever_the_order_of_their_points() -> None:
    rng = np.random.default_rng(7)
    points = rng.integers(0, 40, (3000, 3)) * 0.05 + rng.random((3000, 3)) * 0.01
    tags = rng.integers(0, 3, len(points), dtype=np.uint8)
    first = Cells.of(points, tags, SIDE_M)
    order = rng.permutation(len(points))
    other = Cells.of(points[order], tags[order], SIDE_M)
    for name in ("keys", "counts", "steps"):
        assert np.array_equal(getattr(first, name), getattr(other, name))
    assert first.counts.sum() == len(points)
    assert (np.diff(first.keys) > 0).all()
    scaled = points / SIDE_M
    steps = ((scaled - np.floor(scaled)) * 256).astype(np.int64)
    assert np.array_equal(first.steps.sum(axis=0), steps.sum(axis=0))


def test_of_equally_many_votes_the_lowest_tag_wins_also_where_few_tags_occur() -> None:
    points = np.array([[3.0, 0.0, 0.1], [3.1, 0.0, 0.1], [3.0, 0.1, 0.1]])
    cells = Cells.of(points, np.array([40, 7, 7], np.uint8), 1.0)
    tied = Cells(cells.keys, np.full(len(cells.keys), 2), cells.steps)
    for still, winner in ((cells, 7), (tied, 7)):
        voxels = Placer(GRID, Gathered(still, {})).place(np.eye(4), [])
        assert set(np.unique(voxels.semantic).tolist()) == {winner, 255}
    nothing = Cells.of(np.zeros((0, 3)), np.zeros(0, np.uint8), SIDE_M)
    assert (Placer(GRID, Gathered(nothing, {})).place(np.eye(4), []).semantic == 255).all()
