"""Voxels of small made-up scenes: rays, gathering, placing, files."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from carstage.birds_eye import CameraView, Cloud
from carstage.birds_eye.visibility import CAMERA, LIDAR
from carstage.errors import AnnotationError
from carstage.geometry import intrinsics, pose_matrix
from carstage.occupancy import (
    FREE,
    Gathered,
    Occupancy,
    Picture,
    Placer,
    Sweep,
    VoxelGrid,
    Voxels,
    grid_from_world,
    pack_occupancy,
    seen_voxels,
    surface,
    unpack_occupancy,
)
from carstage.occupancy.gathering import Cells, Gathering
from carstage.occupancy.seeing import passed_voxels
from carstage.spec import OccupancySpec

GRID = VoxelGrid((-8.0, -8.0, -1.0), (40, 40, 10), 0.4)
HERE = pose_matrix([100.0, 50.0, 2.0], [0.0, 90.0, 0.0])
"""Looks along the world's y; its left is the world's x."""
BUILDING, CAR, RIDER = 3, 14, 13


def car(track_id: int, x: float, y: float, yaw_deg: float = 0.0, **more: Any) -> dict[str, Any]:
    return {
        "track_id": track_id, "class": "car", "is_ego": False, "box_center": [x, y, 2.75],
        "box_rotation_deg": [0.0, yaw_deg, 0.0], "box_extent": [2.0, 1.0, 0.75],
        "actor_location": [x, y, 2.0], "actor_rotation_deg": [0.0, yaw_deg, 0.0],
        "velocity": [0.0, 0.0, 0.0], "angular_velocity": [0.0, 0.0, 0.0], **more,
    }  # fmt: skip


def sweep(points: NDArray[np.float64], tag: int, pose: NDArray[np.float64] = HERE) -> Sweep:
    return Sweep(Cloud(pose, points), np.full(len(points), tag, np.uint8))


def place(pose: NDArray[np.float64], gathered: Gathered, rows: list[dict[str, Any]]) -> Voxels:
    return Placer(GRID, gathered).place(pose, rows)


def occupied(content: NDArray[np.uint8]) -> list[list[int]]:
    return np.argwhere(content != FREE).tolist()


def test_the_grid_counts_from_behind_right_and_below_and_is_that_of_occ3d() -> None:
    grid = VoxelGrid.of(OccupancySpec())
    assert (grid.shape, grid.low_m) == ((200, 200, 16), (-40.0, -40.0, -1.0))
    assert grid.centres(np.array([0]))[0] == pytest.approx([-39.8, -39.8, -0.8])
    assert grid.centres(np.array([grid.count - 1]))[0] == pytest.approx([39.8, 39.8, 5.2])
    ahead_left_up = [100.0 + 3.0, 50.0 + 5.0, 2.0 + 1.0]
    found = grid_from_world(HERE) @ [*ahead_left_up, 1.0]
    assert found[:3] == pytest.approx([5.0, 3.0, 1.0])


def test_a_point_of_a_sweep_is_in_its_voxel_and_keeps_its_tag() -> None:
    # 5 m ahead, 3 m to the right, 1.1 m up; another one outside
    points = np.array([[5.0, 3.0, 1.1], [50.0, 0.0, 0.0]])
    found = surface(GRID, grid_from_world(HERE), sweep(points, BUILDING))
    assert found.points.astype(int).tolist() == [[32, 12, 5]]
    assert found.tags is not None
    assert found.tags.tolist() == [BUILDING]
    assert found.beyond == pytest.approx(np.array([[58.0, 8.0, 1.0]]) / 0.4)


def test_a_picture_shows_each_cell_of_a_wall_once() -> None:
    k = intrinsics(400, 200, 90.0)
    view = CameraView(k, HERE, np.full((200, 400), 4.1, np.float32), 400, 200)
    tags = np.full((200, 400), BUILDING, np.uint8)
    found = surface(GRID, grid_from_world(HERE), Picture(view, tags))
    cells = np.floor(found.points * 2).astype(int)
    assert len(np.unique(cells, axis=0)) == len(cells)
    assert (cells[:, 0] == int((4.1 + 8.0) / 0.2)).all()
    left = cells[:, 1] * 0.2 - 8.0
    assert (left.min(), left.max()) == (pytest.approx(-4.2), pytest.approx(4.0))
    up = cells[:, 2] * 0.2 - 1.0
    assert (up.min(), up.max()) == (pytest.approx(-1.0), pytest.approx(2.0))


def along(start: NDArray[np.float64], end: NDArray[np.float64]) -> set[tuple[int, ...]]:
    """Voxels of a ray, looked up at many places of it."""
    places = start + np.linspace(0.0, 1.0, 20_001)[:, None] * (end - start)
    inside = ((places >= 0.0) & (places < GRID.shape)).all(axis=1)
    return set(map(tuple, places[inside].astype(int).tolist()))


def test_a_ray_sees_the_voxels_that_it_passes_and_no_others() -> None:
    rng = np.random.default_rng(3)
    for _ in range(40):
        start = rng.uniform(-20.0, 60.0, 3) * [1.0, 1.0, 0.2]
        end = rng.uniform(-20.0, 60.0, 3) * [1.0, 1.0, 0.2]
        seen = passed_voxels(GRID, start, end[None])
        found = set(map(tuple, np.argwhere(seen).tolist()))
        sampled = along(start, end)
        assert sampled <= found
        assert len(found - sampled) <= 1  # a corner that no sample has met


def test_rays_along_an_axis_and_of_no_length_are_seen() -> None:
    start = np.array([5.5, 6.5, 7.5])
    ends = np.array([[9.5, 6.5, 7.5], [5.5, 6.5, 7.5]])
    seen = passed_voxels(GRID, start, ends)
    assert np.argwhere(seen).tolist() == [[x, 6, 7] for x in range(5, 10)]


def test_what_is_behind_a_wall_is_not_seen_and_the_sky_is() -> None:
    k = intrinsics(400, 200, 90.0)
    depth = np.full((200, 400), 4.1, np.float32)
    depth[:40] = 1000.0
    view = CameraView(k, HERE, depth, 400, 200)
    matrix, picture = grid_from_world(HERE), Picture(view, None)
    seen = seen_voxels(GRID, matrix, [picture], [surface(GRID, matrix, picture)]) > 0
    assert seen[22:31, 20, 3].all()
    assert not seen[31:, 20, 3].any()
    assert seen[38:, 20, 9].all()
    assert not seen[:20].any()


def test_still_surfaces_of_several_frames_come_together_in_another_frame() -> None:
    gathering = Gathering(GRID)
    ahead = np.array([[5.0, 0.1, 1.1]])
    gathering.add(HERE, [], [sweep(ahead, BUILDING)])
    there = pose_matrix([101.0, 55.0, 2.0], [0.0, 180.0, 0.0])
    gathering.add(there, [], [sweep(np.array([[1.1, 2.0, 1.1]]), 9, there)])
    gathered = gathering.end()
    voxels = place(HERE, gathered, [])
    world = [[99.9, 55.0, 3.1], [99.9, 53.0, 3.1]]
    # x of the world is to the left of it
    cells = [
        [int((y - 50.0 + 8.0) / 0.4), int((x - 100.0 + 8.0) / 0.4), int((z - 2.0 + 1.0) / 0.4)]
        for x, y, z in world
    ]
    assert sorted(occupied(voxels.semantic)) == sorted(cells)
    assert {int(voxels.semantic[tuple(cell)]) for cell in cells} == {BUILDING, 9}
    assert not voxels.instance.any()


def test_most_votes_decide_and_the_order_of_parts_does_not_matter() -> None:
    def cells(tag: int, times: int) -> Gathered:
        one = Cells.of(np.array([[100.0, 55.0, 3.0]]), np.array([tag], np.uint8), 0.2)
        return Gathered(Cells.together([one] * times), {})

    few, many = cells(1, 2), cells(7, 3)
    for parts in ([few, many], [many, few]):
        voxels = place(HERE, Gathered.together(parts), [])
        assert voxels.semantic[voxels.semantic != FREE].tolist() == [7]


def test_a_cell_remembers_where_its_surface_is() -> None:
    points = np.array([[0.05, -0.05, 12.31], [0.09, -0.05, 12.31]])
    found = Cells.of(points, np.array([1, 1], np.uint8), 0.2)
    assert found.counts.tolist() == [2]
    assert found.points(0.2)[0] == pytest.approx([0.07, -0.05, 12.31], abs=0.2 / 256)
    with pytest.raises(AnnotationError, match="km from the map's origin"):
        Cells.of(np.array([[1e6, 0.0, 0.0]]), np.array([1], np.uint8), 0.2)


def test_a_moving_car_is_where_its_box_is_and_leaves_no_trail() -> None:
    gathering = Gathering(GRID)
    side = np.stack([np.linspace(3.0, 7.0, 60), np.full(60, -2.0), np.full(60, 0.5)], axis=-1)
    # It stands along the world's y, 2 m to the left of the ego.
    first = car(7, 103.0, 55.0, 90.0)
    gathering.add(HERE, [first], [sweep(side, CAR)])
    later = car(7, 103.0, 48.0, 90.0, velocity=[0.0, -5.0, 0.0], angular_velocity=[0.0, 0.0, 0.5])
    gathering.add(HERE, [later], [])
    gathered = gathering.end()
    assert not len(gathered.still.keys)
    voxels = place(HERE, gathered, [later])
    where = np.argwhere(voxels.instance == 1)
    assert voxels.track_id.tolist() == [7]
    assert set(voxels.semantic[voxels.semantic != FREE].tolist()) == {CAR}
    forward, left, up = (where * 0.4 + np.array(GRID.low_m)).T
    assert (forward.min(), forward.max()) == (
        pytest.approx(-4.0, abs=0.41),
        pytest.approx(0.0, abs=0.41),
    )
    assert set(np.round(left, 2)) <= {1.6, 2.0}
    assert set(np.round(up, 2)) == {0.2}
    assert place(HERE, gathered, []).track_id.tolist() == []


def test_flow_is_the_box_s_motion_in_every_voxel() -> None:
    turning = 0.8
    before, after = (
        car(5, 103.0, 53.0 + 4.0 * t, 90.0 + np.degrees(turning * t), velocity=[0.0, 4.0, 0.0],
            angular_velocity=[0.0, 0.0, turning])
        for t in (0.0, 1e-4)
    )  # fmt: skip
    grid = np.linspace(-1.0, 1.0, 21)
    box = np.stack(np.meshgrid(1.9 * grid, 0.9 * grid, 0.7 * grid), axis=-1).reshape(-1, 3)
    cells = Cells.of(box, np.full(len(box), CAR, np.uint8), 0.2)
    empty = Cells.of(np.zeros((0, 3)), np.zeros(0, np.uint8), 0.2)
    voxels = place(HERE, Gathered(empty, {5: cells}), [before])
    content = Occupancy(GRID, HERE, voxels, np.zeros(GRID.shape, np.uint8))
    there = content.tracks == 5
    poses = [pose_matrix(row["box_center"], row["box_rotation_deg"]) for row in (before, after)]
    centres = np.c_[content.centres()[there], np.ones(there.sum())]
    matrix = grid_from_world(HERE)
    moved = (matrix @ poses[1] @ np.linalg.inv(poses[0]) @ np.linalg.inv(matrix) @ centres.T).T
    expected = (moved - centres)[:, :3] / 1e-4
    assert content.flow_m_s[there] == pytest.approx(expected, abs=0.01)
    assert np.ptp(content.flow_m_s[there][:, 0]) > 0.5
    assert not content.flow_m_s[~there].any()


def test_a_rider_keeps_its_tag_and_has_its_two_wheeler_s_instance() -> None:
    bike = car(9, 103.0, 53.0, 90.0, **{"class": "bicycle"})
    gathering = Gathering(GRID)
    points = np.array([[3.0, -3.0, 0.3], [3.0, -3.0, 1.3]])
    seen = Sweep(Cloud(HERE, points), np.array([19, RIDER], np.uint8))
    gathering.add(HERE, [bike], [seen])
    voxels = place(HERE, gathering.end(), [bike])
    assert sorted(voxels.semantic[voxels.instance == 1].tolist()) == [RIDER, 19]


def test_the_ego_and_road_users_without_a_box_are_left_out() -> None:
    gathering = Gathering(GRID)
    ego = car(1, 100.0, 50.0, 90.0, is_ego=True)
    gathering.add(HERE, [ego], [sweep(np.array([[1.0, 0.5, 0.5], [6.0, 0.0, 0.5]]), CAR)])
    voxels = place(HERE, gathering.end(), [ego])
    assert occupied(voxels.semantic) == []


def test_masks_tell_cameras_from_lidars() -> None:
    k = intrinsics(40, 20, 90.0)
    depth = np.full((20, 40), 4.1, np.float32)
    picture = Picture(CameraView(k, HERE, depth, 40, 20), None)
    behind = sweep(np.array([[-5.0, 0.1, 0.1]]), BUILDING)
    seen = Gathering(GRID).add(HERE, [], [picture, behind])
    assert seen[25, 20, 2] == CAMERA
    assert seen[10, 19, 2] == LIDAR
    assert seen[20, 20, 2] & LIDAR


def test_equal_voxels_are_equal_bytes_and_damage_is_named() -> None:
    gathering = Gathering(GRID)
    seen = gathering.add(HERE, [car(7, 103.0, 53.0)], [sweep(np.array([[3.0, -3.0, 0.5]]), CAR)])
    voxels = place(HERE, gathering.end(), [car(7, 103.0, 53.0)])
    content = Occupancy(GRID, HERE, voxels, seen)
    packed = pack_occupancy(content)
    again = unpack_occupancy(packed)
    assert pack_occupancy(again) == packed
    assert again.grid == GRID
    assert again.tracks[again.occupied].tolist() == [7]
    with pytest.raises(ValueError, match="damaged NPZ"):
        unpack_occupancy(packed[: len(packed) // 2])
    voxels.instance[0, 0, 0] = 2
    with pytest.raises(ValueError, match="does not list"):
        unpack_occupancy(pack_occupancy(content))
    voxels.instance[0, 0, 0] = 0
    with pytest.raises(ValueError, match="seen has shape"):
        unpack_occupancy(pack_occupancy(replace(content, seen=seen[1:])))
