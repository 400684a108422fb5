"""The benchmark's own voxels: those of a plane, and what they find in wrong ones."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.framework.mesh_voxels import MeshVoxels, Surfaces, joined
from carstage.geometry import pose_matrix
from carstage.occupancy import FREE, Occupancy, VoxelGrid, Voxels

GRID = VoxelGrid((-4.0, -4.0, -1.0), (40, 40, 10), 0.2)
HERE = pose_matrix([30.0, -20.0, 1.0], [0.0, 30.0, 0.0])
ROAD, WALK, CAR = 1, 2, 14


def slab(low_y: float, high_y: float, tag: int, z: float = 1.1) -> Surfaces:
    """Two triangles: a level strip along the grid's axis to the front, left of ``low_y``."""
    flu = np.array([[-9, low_y, z - 1], [9, low_y, z - 1], [9, high_y, z - 1], [-9, high_y, z - 1]])
    world = (flu * [1, -1, 1]) @ HERE[:3, :3].T + HERE[:3, 3]
    return Surfaces(world[[[0, 1, 2], [0, 2, 3]]], np.full(2, tag, np.uint8))


def content(semantic: NDArray[np.uint8]) -> Occupancy:
    none = np.zeros((0, 3), np.float32)
    instance = np.zeros(GRID.shape, np.uint16)
    voxels = Voxels(semantic, instance, np.zeros(0, np.int64), none, none, none)
    return Occupancy(GRID, HERE, voxels, np.zeros(GRID.shape, np.uint8))


def street() -> NDArray[np.uint8]:
    """A road to the right of 0.1 m, a pavement to the left: the border halves a row of voxels."""
    semantic: NDArray[np.uint8] = np.full(GRID.shape, FREE, np.uint8)
    semantic[:, :20, 5], semantic[:, 20:, 5] = ROAD, WALK
    return semantic


def agreement(semantic: NDArray[np.uint8], surfaces: Surfaces) -> tuple[float, dict[int, float]]:
    voxels = MeshVoxels(3.0)
    voxels.add(content(semantic), surfaces, np.zeros(GRID.shape, np.bool_))
    return voxels.ious()


def test_right_voxels_agree_in_all() -> None:
    surfaces = joined([slab(-9.0, 0.05, ROAD), slab(0.05, 9.0, WALK)])
    assert agreement(street(), surfaces) == (1.0, {ROAD: 1.0, WALK: 1.0})


def test_a_road_user_goes_before_the_town() -> None:
    surfaces = joined([slab(-9.0, 9.0, ROAD), slab(-9.0, -0.01, CAR, z=1.15)])
    semantic = street()
    semantic[semantic == ROAD], semantic[semantic == WALK] = CAR, ROAD
    assert agreement(semantic, surfaces) == (1.0, {ROAD: 1.0, CAR: 1.0})


def test_a_hole_a_wrong_class_and_a_wrong_height_are_found() -> None:
    surfaces = joined([slab(-9.0, 0.05, ROAD), slab(0.05, 9.0, WALK)])
    hole = street()
    hole[20:23] = FREE  # three of thirty rows
    assert agreement(hole, surfaces) == pytest.approx((0.9, {ROAD: 0.9, WALK: 0.9}))
    wrong = street()
    wrong[20:23, :, 5] = CAR
    occupied, classes = agreement(wrong, surfaces)
    assert (occupied, classes[ROAD]) == (1.0, pytest.approx(0.9))
    assert agreement(np.roll(street(), 1, axis=2), surfaces)[0] == 0.0
