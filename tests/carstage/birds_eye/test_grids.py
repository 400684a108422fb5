"""Which cells shapes cover, and what rays reach: beside Shapely and by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

import small_maps
from carstage.birds_eye import (
    LAYERS,
    BirdsEye,
    CameraView,
    Cloud,
    Grid,
    GridPose,
    TownShapes,
    draw_birds_eye,
    pack_birds_eye,
    unpack_birds_eye,
)
from carstage.birds_eye.town import _polygon, _ribbon
from carstage.geometry import intrinsics, pose_matrix
from carstage.vector_map import vector_map

GRID = Grid(20.0, 30.0, 0.2)
MIDDLE = GridPose(0.0, 0.0, 0.0, 0.0)


def cells_of(triangles: np.ndarray, grid: Grid = GRID) -> np.ndarray:
    """How often each cell is covered by triangles ``(N, 3, 2)`` forward and right."""
    _, cells = grid.covered(grid.units(triangles))
    return np.bincount(cells, minlength=grid.shape[0] * grid.shape[1]).reshape(grid.shape)


def box_at(x: float, y: float, **changes: Any) -> dict[str, Any]:
    return {
        "track_id": 7, "class": "car", "is_ego": False, "box_center": [x, y, 0.8],
        "box_extent": [2.0, 1.0, 0.8], "box_rotation_deg": [0.0, 0.0, 0.0],
        "velocity": [3.0, 4.0, 0.0], **changes,
    }  # fmt: skip


def test_triangles_cover_the_cells_whose_centres_shapely_has_in_them() -> None:
    triangles = np.random.default_rng(1).uniform(-18.0, 18.0, (60, 3, 2))
    centres = shapely.points(GRID.cell_centres())
    for triangle in np.rint(triangles * 1e4) / 1e4:
        expected = shapely.contains(shapely.Polygon(triangle), centres)
        assert (cells_of(triangle[None]) == expected).all()


def test_triangles_that_share_edges_share_no_cell_and_leave_none_out() -> None:
    """Corners lie on centres of cells, so that edges run through many centres."""
    rng = np.random.default_rng(2)
    hub = np.array([0.1, 0.3])
    ring = np.array([[-9.9, -14.9], [-9.9, 14.9], [9.9, 14.9], [9.9, -14.9]])
    turns = np.sort(rng.choice(40, 9, replace=False)) / 10.0
    corners = np.array(
        [ring[int(t)] + (t % 1.0) * (ring[(int(t) + 1) % 4] - ring[int(t)]) for t in turns]
    )
    fan = np.array(
        [[hub, a, b] for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )
    covered = cells_of(fan)
    assert covered.max() == 1
    inside = shapely.contains(
        shapely.Polygon(corners).buffer(-1e-3), shapely.points(GRID.cell_centres())
    )
    assert (covered[inside] == 1).all()


def test_grids_are_turned_with_the_ego_and_forward_is_up() -> None:
    east = GridPose(100.0, 50.0, 0.0, 90.0)
    drawn = draw_birds_eye(GRID, east, None, [box_at(100.0, 57.0, box_rotation_deg=[0, 90, 0])])
    rows, columns = np.nonzero(drawn.semantic)
    centres = GRID.cell_centres()[rows, columns]
    assert np.abs(centres - (7.0, 0.0)).max(axis=0) == pytest.approx((1.9, 0.9))
    assert drawn.velocity_m_s.tolist() == [pytest.approx([4.0, -3.0])]
    assert rows.max() < GRID.shape[0] // 2
    content = BirdsEye(GRID, east, drawn)
    assert content.layer("car").sum() == 200
    assert np.abs(content.world()[content.layer("car")] - (100.0, 57.0)).max() < 2.0


def test_the_instance_is_the_highest_box_and_layers_are_those_of_all() -> None:
    walker = box_at(0.0, 0.0, track_id=3, box_extent=[0.4, 0.4, 0.9], **{"class": "walker_adult"})
    truck = box_at(1.0, 0.0, track_id=9, box_center=[1.0, 0.0, 1.5], **{"class": "truck"})
    light = box_at(0.0, 5.0, track_id=4, **{"class": "traffic_light"})
    content = BirdsEye(GRID, MIDDLE, draw_birds_eye(GRID, MIDDLE, None, [truck, light, walker]))
    assert content.tracks[content.layer("truck")].tolist() == [9] * 200
    assert content.layer("pedestrian").sum() == 16
    assert content.drawn.track_id.tolist() == [9]  # the pedestrian's cells are all below the truck


def test_layers_of_a_street_are_as_wide_as_its_lanes() -> None:
    town = TownShapes.of(vector_map(small_maps.parking_street()), 0.2)
    pose = GridPose(120.0, 0.0, -1.0, 0.0)
    content = BirdsEye(GRID, pose, draw_birds_eye(GRID, pose, town, []))
    right = GRID.cell_centres()[0, :, 1]
    widths = {name: content.layer(name)[0].sum() * 0.2 for name in LAYERS}
    assert widths["lane"] == pytest.approx(7.0, abs=0.21)
    assert widths["parking"] == pytest.approx(4.8, abs=0.41)
    assert widths["sidewalk"] == pytest.approx(6.0, abs=0.41)
    assert (
        content.layer("drivable_area") == content.layer("lane") | content.layer("parking")
    ).all()
    assert (np.diff(content.semantic, axis=0) == 0).all()
    on_road = np.abs(right) < 5.0
    assert content.height_m[:, on_road] == pytest.approx(1.0)
    assert np.isnan(content.height_m[:, np.abs(right) > 9.0]).all()
    markings = right[content.layer("solid_marking")[0]]
    assert np.diff(markings).min() > 0.1
    assert len(markings) == 6


def test_height_is_that_of_the_level_of_the_ego() -> None:
    town = TownShapes.of(vector_map(small_maps.crossing_on_two_levels()), 0.2)
    for z in (0.0, 6.0):
        pose = GridPose(0.0, 0.0, z, 0.0)
        content = BirdsEye(GRID, pose, draw_birds_eye(GRID, pose, town, []))
        assert content.height_m[50, 75] == pytest.approx(0.0, abs=0.05)


def test_a_wall_hides_the_ground_behind_it_from_camera_and_lidar() -> None:
    town = TownShapes.of(vector_map(small_maps.one_road()), 0.2)
    grid, pose = Grid(40.0, 10.0, 0.2), GridPose(100.0, 0.0, 0.0, 0.0)
    k, eye = intrinsics(640, 360, 90.0), pose_matrix([100.0, 0.0, 1.6], [0.0, 0.0, 0.0])
    below = (np.arange(360) + 0.5 - k[1, 2]) / k[1, 1]
    ground = np.where(below > 0.0, 1.6 / np.maximum(below, 1e-9), 1000.0).clip(max=1000.0)
    depth = np.repeat(np.minimum(ground, 10.0)[:, None], 640, axis=1).astype(np.float32)
    cloud = Cloud(eye, np.array([[8.05, 1.05, -1.6], [8.0, 100.0, 0.0]]))
    view = CameraView(k, eye, depth, 640, 360)
    drawn = draw_birds_eye(grid, pose, town, [], (), [view], [cloud])
    content = BirdsEye(grid, pose, drawn)
    forward, right = np.moveaxis(grid.cell_centres(), -1, 0)
    road = content.layer("lane") & (np.abs(right) < 3.0)
    seen = content.visible_by_camera
    assert seen[road & (forward > 4.0) & (forward < 10.0)].all()
    assert not seen[road & (forward > 12.0)].any()
    assert not seen[forward < 0.0].any()
    assert not seen[~content.layer("lane")].any()
    assert np.argwhere(content.visible_by_lidar).tolist() == [[59, 30]]


def test_cells_of_an_object_are_visible_where_a_camera_sees_it() -> None:
    boxes = [box_at(5.0, 0.0), box_at(-5.0, 0.0, track_id=8)]
    content = BirdsEye(GRID, MIDDLE, draw_birds_eye(GRID, MIDDLE, None, boxes, seen_tracks={8}))
    assert (content.visible_by_camera == (content.tracks == 8)).all()


def test_polygons_that_turn_inwards_and_lines_that_bend_have_their_area() -> None:
    ring = [(0, 0), (4, 0), (4, 4), (2, 1), (0, 4), (0, 0)]
    for corners in (ring, ring[::-1]):
        triangles = _polygon(np.array([(x, y, 0.0) for x, y in corners]))
        expected = shapely.Polygon(corners).area
        assert shapely.area(shapely.polygons(triangles[:, :, :2])).sum() == pytest.approx(expected)
    bend = np.array([(0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (5.0, 0.0, 0.0), (9.0, 3.0, 0.0)])
    made = shapely.union_all(shapely.polygons(_ribbon(bend, 0.5)[:, :, :2]))
    line = shapely.LineString(bend[:, :2]).buffer(0.25, cap_style="flat", join_style="mitre")
    assert made.symmetric_difference(line).area < 1e-9


def test_equal_grids_are_equal_bytes_and_damage_is_named() -> None:
    drawn = draw_birds_eye(GRID, MIDDLE, None, [box_at(1.0, 2.0)])
    content = pack_birds_eye(BirdsEye(GRID, MIDDLE, drawn))
    again = unpack_birds_eye(content)
    assert pack_birds_eye(again) == content
    assert (again.grid, again.pose) == (GRID, MIDDLE)
    with pytest.raises(ValueError, match="damaged NPZ"):
        unpack_birds_eye(content[: len(content) // 2])
    drawn.instance[0, 0] = 2
    with pytest.raises(ValueError, match="does not list"):
        unpack_birds_eye(pack_birds_eye(BirdsEye(GRID, MIDDLE, drawn)))
