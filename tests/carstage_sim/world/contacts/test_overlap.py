from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from carstage_sim.geometry import rotation_matrix
from carstage_sim.world.contacts.overlap import overlaps

coordinates = st.floats(-4.0, 4.0)
centers = st.tuples(coordinates, coordinates, coordinates)
extents = st.tuples(*[st.floats(0.2, 3.0)] * 3)
yaws = st.floats(-180.0, 180.0)


def overlap(a: tuple, b: tuple) -> bool:  # type: ignore[type-arg]
    (center_a, extent_a, yaw_a), (center_b, extent_b, yaw_b) = a, b
    hit = overlaps(
        np.array(center_a),
        np.array(extent_a),
        yaw_a,
        np.array([center_b]),
        np.array([extent_b]),
        np.array([yaw_b]),
    )
    return bool(hit[0])


boxes = st.tuples(centers, extents, yaws)


@given(boxes, boxes)
def test_overlap_is_mutual(a: tuple, b: tuple) -> None:  # type: ignore[type-arg]
    assert overlap(a, b) == overlap(b, a)


@given(boxes, boxes)
def test_box_that_holds_a_point_of_another_overlaps_it(a: tuple, b: tuple) -> None:  # type: ignore[type-arg]
    grid = np.linspace(-0.99, 0.99, 7)
    unit = np.stack(np.meshgrid(grid, grid, grid), axis=-1).reshape(-1, 3)
    (center_a, extent_a, yaw_a), (center_b, extent_b, yaw_b) = a, b
    points = (unit * extent_b) @ rotation_matrix((0.0, yaw_b, 0.0)).T + center_b
    local = (points - center_a) @ rotation_matrix((0.0, yaw_a, 0.0))
    if (np.abs(local) < np.array(extent_a) * 0.999).all(axis=1).any():
        assert overlap(a, b)


def test_boxes_far_apart_turned_or_above_do_not_overlap() -> None:
    car = ((0.0, 0.0, 0.8), (2.4, 1.0, 0.8), 0.0)
    assert not overlap(car, ((5.0, 0.0, 0.8), (2.4, 1.0, 0.8), 0.0))
    assert not overlap(car, ((0.0, 0.0, 5.0), (2.4, 1.0, 0.8), 0.0))
    # Their axis-aligned bounds overlap, they do not: only the turned box's own axis parts them.
    assert not overlap(car, ((2.6, 1.9, 0.8), (1.4, 0.3, 0.8), -45.0))
    assert overlap(car, ((2.2, 1.0, 0.8), (1.4, 0.3, 0.8), -45.0))


def test_touching_boxes_do_not_overlap() -> None:
    one = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.0)
    assert not overlap(one, ((2.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.0))
