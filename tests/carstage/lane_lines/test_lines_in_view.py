"""Lines in pictures: projected, cut at the edges and by depth; small cases worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

import small_maps
from carstage.config import parse_config
from carstage.errors import CarStageError
from carstage.geometry import intrinsics, pose_matrix
from carstage.lane_lines import PictureView, TownLines, lines_in_view
from carstage.lane_lines.town import with_steps
from carstage.report.lane_lines import LINE_COLOURS, draw_lane_lines
from carstage.vector_map import vector_map

WIDTH, HEIGHT, FOCAL = 200, 100, 100.0
K = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1.0]])
CAMERA_M = 1.5
ROAD = small_maps.road(
    1, 0.0, 0.0, 0.0, 200.0,
    lanes=(("driving", 3.5), ("sidewalk", 2.0)),
    objects='<object id="7" type="crosswalk" name="walk" s="40" t="0" length="3" width="7" '
    'hdg="0"/>'
    '<object id="8" name="Stencil_ArrowType4R" type="-1" s="30" t="-1.75" hdg="0" length="3" '
    'width="1"/>',
    signals=small_maps.light(9, 35.0, (-1, -1)),
)  # fmt: skip


@pytest.fixture(scope="module")
def town() -> TownLines:
    return TownLines.of(vector_map(small_maps.document(ROAD)))


def ground_depth(y: float = CAMERA_M) -> np.ndarray:
    """What a level camera above a plane sees: the plane below the horizon."""
    rows = np.arange(HEIGHT) + 0.5 - HEIGHT / 2
    depth = np.where(rows > 0, FOCAL * y / np.maximum(rows, 1e-9), 1000.0)
    return np.repeat(depth[:, None], WIDTH, axis=1).astype(np.float32)


def view(depth: np.ndarray, range_m: float = 80.0, y: float = 1.75) -> PictureView:
    """From the right lane, 20 m on, along the road."""
    pose = pose_matrix([20.0, y, CAMERA_M], [0.0, 0.0, 0.0])
    return PictureView(K, pose, depth, range_m)


def by_name(rows: list[dict]) -> dict[tuple[str, str], dict]:
    return {(row["kind"], row["map_id"]): row for row in rows}


def test_a_straight_marking_is_where_similar_triangles_put_it(town) -> None:
    rows = by_name(lines_in_view(town, view(ground_depth())))
    mark = rows["marking", "1/0/-1/0"]
    u, v, x, y, z = (np.array(mark[name]) for name in "uvxyz")
    np.testing.assert_allclose(x, 1.75, atol=1e-3)
    np.testing.assert_allclose(y, CAMERA_M, atol=1e-3)
    np.testing.assert_allclose(u, WIDTH / 2 + FOCAL * 1.75 / z, atol=0.02)
    np.testing.assert_allclose(v, HEIGHT / 2 + FOCAL * CAMERA_M / z, atol=0.02)
    # Its nearest place is on the lower edge of the picture, its farthest one at the range.
    assert v.max() == pytest.approx(HEIGHT, abs=0.01)
    assert z.max() == pytest.approx(80.0, abs=1e-3)
    assert np.diff(np.sort(z)).max() <= 1.0 + 1e-3
    assert set(mark["visible"]) == {1}
    assert mark["visible_share"] == 1.0
    assert (mark["type"], mark["colour"], mark["width"]) == ("solid", "white", 0.15)


def test_a_wall_hides_what_lies_behind_it(town) -> None:
    depth = np.minimum(ground_depth(), 30.0)
    rows = by_name(lines_in_view(town, view(depth)))
    mark = rows["marking", "1/0/-1/0"]
    z, seen = np.array(mark["z"]), np.array(mark["visible"], bool)
    assert z[seen].max() < 31.0
    assert z[~seen].min() > 30.0
    assert mark["visible_share"] == pytest.approx(seen.mean(), abs=1e-3)
    hidden = lines_in_view(town, view(np.full((HEIGHT, WIDTH), 1.0, np.float32)))
    assert hidden == []


def test_areas_are_cut_at_the_picture_and_their_share_is_of_what_is_in_it(town) -> None:
    rows = by_name(lines_in_view(town, view(ground_depth())))
    walk = rows["crosswalk", "7"]
    assert sorted(np.round(walk["z"]).tolist()) == [18.0, 18.0, 22.0, 22.0]
    assert walk["visible_share"] == 1.0
    assert ("stop_line", "1/0/-1@35.000") in rows
    # A wall over the left half of the picture hides the part of the crosswalk there: from 5.25 m
    # to the left of the camera to 1.75 m to its right, three quarters.
    depth = ground_depth()
    depth[:, : WIDTH // 2] = 5.0
    half = by_name(lines_in_view(town, view(depth)))["crosswalk", "7"]
    assert half["visible_share"] == pytest.approx(0.25, abs=0.06)


def test_an_arrow_is_the_rectangle_around_it(town) -> None:
    arrow = by_name(lines_in_view(town, view(ground_depth())))["painted_object", "8"]
    assert (arrow["type"], arrow["colour"], arrow["visible_share"]) == ("arrow", "white", 1.0)
    assert sorted(arrow["x"]) == pytest.approx([-0.5, -0.5, 0.5, 0.5], abs=1e-3)
    assert sorted(arrow["z"]) == pytest.approx([8.5, 8.5, 11.5, 11.5], abs=1e-3)


def test_a_boundary_without_paint_is_a_boundary(town) -> None:
    rows = by_name(lines_in_view(town, view(ground_depth())))
    middle = rows["boundary", "1/0/-1/left"]
    assert (middle["type"], middle["width"]) == ("", 0.0)
    np.testing.assert_allclose(middle["x"], -1.75, atol=1e-3)


@pytest.mark.parametrize("side", [1, -1])
def test_what_is_left_bare_of_a_painted_boundary_is_a_boundary(side: int) -> None:
    solid = '<roadMark sOffset="0" type="solid" color="white" width="0.15"/>'
    parts = (
        '<roadMark sOffset="0" type="none"/><roadMark sOffset="50" type="broken" color="white"/>'
        '<roadMark sOffset="80" type="solid" color="white"/><roadMark sOffset="120" type="none"/>'
    )
    lines = TownLines.of(vector_map(small_maps.one_road().replace(solid, parts))).lines
    found = {
        line.map_id: line.places
        for line in lines
        if line.kind == "boundary" and line.map_id.startswith(f"1/0/{side}/right")
    }
    names = [f"1/0/{side}/right", f"1/0/{side}/right/1"]
    assert sorted(found) == names
    ends = [(found[name][:, 0].min(), found[name][:, 0].max()) for name in names]
    assert sorted(ends) == [(0.0, 50.0), (120.0, 200.0)]
    assert all((places[:, 1] == -side * 3.5).all() for places in found.values())


def test_what_leaves_the_picture_and_comes_back_has_parts() -> None:
    from carstage.lane_lines.projection import _cut_line, _planes

    planes = _planes(view(ground_depth()))
    line = np.array([[0, 0, 10.0], [0, 20.0, 10.0], [0, 20.0, 12.0], [0, 0, 12.0], [0, 0, 14.0]])
    parts = _cut_line(line, planes)
    assert [len(part) for part in parts] == [2, 3]
    assert parts[0][1].tolist() == [0.0, 5.0, 10.0]
    assert parts[1][0].tolist() == [0.0, 6.0, 12.0]


def test_nothing_behind_the_camera_is_projected(town) -> None:
    pose = pose_matrix([199.0, 1.75, CAMERA_M], [0.0, 0.0, 0.0])
    beyond = PictureView(K, pose, ground_depth(), 80.0)
    assert all(min(row["z"]) > 0.0 for row in lines_in_view(town, beyond))


def test_steps_keep_places_and_are_no_longer_than_asked() -> None:
    line = np.array([[0.0, 0, 0], [0, 0, 0], [2.5, 0, 0], [2.5, 0.4, 0]])
    found = with_steps(line)
    assert np.linalg.norm(np.diff(found, axis=0), axis=1).max() <= 1.0
    for place in line:
        assert np.abs(found - place).sum(axis=1).min() == 0.0


def test_the_report_draws_each_kind_in_its_colour(town) -> None:
    depth = ground_depth()
    depth[:, : WIDTH // 2] = 8.0
    rows = lines_in_view(town, view(depth))
    drawn = np.asarray(draw_lane_lines(np.zeros((HEIGHT, WIDTH, 3), np.uint8), rows))
    colours = {tuple(colour) for colour in drawn.reshape(-1, 3).tolist()}
    for name in ("white marking", "boundary", "crosswalk", "painted_object", "hidden"):
        assert LINE_COLOURS[name] in colours, name


def test_lines_without_a_vector_map_are_refused() -> None:
    with pytest.raises(CarStageError, match=r"labels.lane_lines.*vector map"):
        parse_config("labels: {lane_lines: true, vector_map: false}")


def test_an_intrinsic_matrix_of_the_camera_fits_the_picture() -> None:
    assert np.allclose(intrinsics(WIDTH, HEIGHT, 90.0), K)
