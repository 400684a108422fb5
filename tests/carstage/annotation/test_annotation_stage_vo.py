"""Golden tests S1-S7: vertices against depth images, levels, the paper's truncation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from carstage.annotation.stage_vo import (
    VertexCounts,
    count_vertices,
    occlusion_level,
    truncation_paper,
    within_distance,
)
from carstage.geometry import (
    FloatArray,
    box_corners,
    intrinsics,
    optical_from_world,
    pose_matrix,
    project,
    transform_points,
)

WIDTH, HEIGHT = 1280, 720
K = intrinsics(WIDTH, HEIGHT, 90.0)


def empty() -> NDArray[np.float32]:
    return np.full((HEIGHT, WIDTH), 1000.0, dtype=np.float32)


def vertices(
    center: Sequence[float], extent: Sequence[float] = (2.3, 0.95, 0.75)
) -> tuple[FloatArray, FloatArray]:
    world = box_corners(pose_matrix(center, [0.0, 0.0, 0.0]), extent)
    optical = transform_points(optical_from_world(np.eye(4)), world)[None]
    return project(optical, K), optical[..., 2]


def classes(counts: VertexCounts) -> tuple[int, int, int, int]:
    found = (counts.visible, counts.occluded, counts.outside, counts.behind)
    visible, occluded, outside, behind = (int(part[0]) for part in found)
    assert visible + occluded + outside + behind == 8
    return visible, occluded, outside, behind


def test_an_unobstructed_box_shows_all_vertices() -> None:
    counts = count_vertices(*vertices((20, 0, 0)), empty())
    assert classes(counts) == (8, 0, 0, 0)
    assert occlusion_level(counts)[0] == 0
    assert truncation_paper(counts.visible)[0] == 0.0


def test_a_wall_in_front_hides_all_vertices() -> None:
    counts = count_vertices(*vertices((20, 0, 0)), np.full_like(empty(), 5.0))
    assert classes(counts) == (0, 8, 0, 0)
    assert occlusion_level(counts)[0] == 2
    assert truncation_paper(counts.visible)[0] == 1.0


@pytest.mark.parametrize(
    ("n_visible", "level", "truncation"), [(6, 0, 0.25), (5, 1, 0.375), (4, 1, 0.5), (3, 2, 0.625)]
)
def test_levels_follow_the_number_of_visible_vertices(
    n_visible: int, level: int, truncation: float
) -> None:
    uv, z = vertices((20, 0, 0))
    depth = empty()
    for u, v in uv[0, : 8 - n_visible]:
        depth[int(v), int(u)] = 5.0
    counts = count_vertices(uv, z, depth)
    assert classes(counts) == (n_visible, 8 - n_visible, 0, 0)
    assert occlusion_level(counts)[0] == level
    assert truncation_paper(counts.visible)[0] == truncation


def test_a_depth_equal_to_the_vertex_does_not_occlude() -> None:
    uv, z = vertices((20.3, 0, 0), (2.3, 0.95, 0.75))
    depth = np.full((HEIGHT, WIDTH), 18.0, dtype=np.float32)
    exact = np.where(z < 20.0, 18.0, 22.6)
    counts = count_vertices(uv, exact, depth)
    assert classes(counts) == (4, 4, 0, 0)
    slack = count_vertices(uv, np.full_like(z, 18.05), depth, tolerance_m=0.1)
    assert classes(slack) == (8, 0, 0, 0)


def test_vertices_outside_the_image_are_not_visible() -> None:
    counts = count_vertices(*vertices((20, -20, 0)), empty())
    assert classes(counts) == (4, 0, 4, 0)
    assert occlusion_level(counts)[0] == 1
    assert truncation_paper(counts.visible)[0] == 0.5


def test_vertices_behind_the_near_plane_read_no_pixel() -> None:
    """Their pixel would have a negative index, which numpy reads from the other side."""
    uv, z = vertices((1.5, 3, 0))
    assert np.isnan(uv[z < 0.1]).all()
    counts = count_vertices(uv, z, np.zeros_like(empty()))
    assert classes(counts)[3] == 4


@pytest.mark.parametrize("pixel", [(-0.5, 5.0), (5.0, -0.5), (WIDTH, 5.0), (5.0, HEIGHT)])
def test_pixels_beyond_an_edge_do_not_wrap_around(pixel: tuple[float, float]) -> None:
    uv = np.tile(pixel, (1, 8, 1))
    counts = count_vertices(uv, np.full((1, 8), 10.0), np.zeros_like(empty()))
    assert classes(counts) == (0, 0, 8, 0)


def test_a_box_around_the_image_gives_no_evidence() -> None:
    counts = count_vertices(*vertices((20, 0, 0), (2.0, 30.0, 30.0)), empty())
    assert classes(counts) == (0, 0, 8, 0)
    assert occlusion_level(counts)[0] == 3
    assert occlusion_level(counts, strict=True)[0] == 2


def test_the_distance_limit_itself_is_kept() -> None:
    centers = np.array([[80.0, 0, 0], [80.0 + 1e-6, 0, 0]])
    assert within_distance(centers, np.zeros(3), 80.0).tolist() == [True, False]


def test_a_vote_needs_all_diagonal_neighbours_nearer() -> None:
    uv, z = vertices((20, 0, 0))
    depth = empty()
    for u, v in uv[0]:
        depth[int(v), int(u)] = 5.0
    assert classes(count_vertices(uv, z, depth)) == (0, 8, 0, 0)
    assert classes(count_vertices(uv, z, depth, vote=True)) == (8, 0, 0, 0)
    wall = np.full_like(depth, 5.0)
    assert classes(count_vertices(uv, z, wall, vote=True)) == (0, 8, 0, 0)
    corner = np.zeros((1, 8, 2))
    assert classes(count_vertices(corner, z, wall, vote=True)) == (0, 8, 0, 0)
