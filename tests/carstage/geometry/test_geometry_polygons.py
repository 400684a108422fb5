"""Hulls, clipping and areas, against shapely and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon, box
from shapely.geometry import MultiPoint

from carstage import geometry as g

coordinates = st.floats(-50, 150, allow_nan=False).map(lambda value: round(value, 3))
point_sets = st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=16)


@given(point_sets)
@settings(max_examples=60, deadline=None)
def test_hull_and_clipped_area_agree_with_shapely(points: list[tuple[float, float]]) -> None:
    hull = g.convex_hull(points)
    expected = MultiPoint(points).convex_hull
    assert g.polygon_area(hull) == pytest.approx(expected.area, abs=1e-6)
    clipped = g.clip_polygon_to_image(hull, 100, 60)
    if isinstance(expected, Polygon):
        inside = expected.intersection(box(0, 0, 100, 60)).area
        assert g.polygon_area(clipped) == pytest.approx(inside, abs=1e-6)
    assert all(0.0 <= x <= 100.0 and 0.0 <= y <= 60.0 for x, y in clipped)


def test_points_on_a_line_have_no_area() -> None:
    assert g.polygon_area(g.convex_hull([(0, 0), (1, 1), (2, 2), (1, 1)])) == 0.0


def test_a_polygon_outside_the_image_is_clipped_away() -> None:
    assert g.clip_polygon_to_image([(-3, 1), (-1, 1), (-2, 4)], 100, 60) == []


def test_clipping_keeps_corners_in_front_and_cuts_edges_at_the_near_plane() -> None:
    corners = g.CORNER_SIGNS + np.array([0.0, 0.0, 0.5])
    cut = g.clip_to_near_plane(corners, 0.1)
    assert len(cut) == 8
    assert cut[:, 2].min() == 0.1
    assert np.count_nonzero(cut[:, 2] == 0.1) == 4


def test_a_box_behind_the_camera_is_clipped_away() -> None:
    corners = g.CORNER_SIGNS - np.array([0.0, 0.0, 5.0])
    assert len(g.clip_to_near_plane(corners, 0.1)) == 0


def test_a_box_in_front_is_untouched() -> None:
    corners = g.CORNER_SIGNS + np.array([0.0, 0.0, 5.0])
    np.testing.assert_array_equal(g.clip_to_near_plane(corners, 0.1), corners)
