"""Reference lines: lines and arcs that meet smoothly and end where they should."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from carstage_sim.maps.writer.alignment import (
    Piece,
    Pose2,
    backward,
    cut,
    length_m,
    offset,
    pose_at,
    project,
)
from carstage_sim.maps.writer.curves import connect, through, turn, two_arcs

lengths = st.floats(1.0, 60.0)
headings = st.floats(-3.0, 3.0)
S_CURVE = (
    Piece(Pose2(3.0, -2.0, 0.4), 30.0, 0.0),
    Piece(Pose2(3.0, -2.0, 0.4).moved(30.0, 0.0), 40.0, 0.02),
)
S_CURVE += (Piece(S_CURVE[-1].end, 25.0, -0.03),)


def assert_smooth(alignment):
    for before, after in pairwise(alignment):
        assert math.dist(before.end.point, after.start.point) < 1e-6
        assert math.remainder(before.end.heading_rad - after.start.heading_rad, math.tau) == (
            pytest.approx(0.0, abs=1e-8)
        )


def assert_joins(alignment, start, end):
    assert_smooth(alignment)
    assert alignment[0].start == start
    reached = alignment[-1].end
    assert math.dist(reached.point, end.point) < 1e-6
    assert math.remainder(reached.heading_rad - end.heading_rad, math.tau) == (
        pytest.approx(0.0, abs=1e-6)
    )


@given(lengths, lengths, st.floats(0.2, 2.4), st.sampled_from([-1.0, 1.0]), headings)
def test_a_turn_reaches_its_end_pose(before, after, angle, side, heading):
    start = Pose2(3.0, -2.0, heading)
    end = start.moved(before, 0.0).turned(side * angle).moved(after, 0.0)
    path = turn(start, end)
    assert_joins(path, start, end)
    (arc,) = (piece for piece in path if piece.curvature_per_m)
    assert math.copysign(1.0, arc.curvature_per_m) == side
    # As wide as fits: one of the two lines is gone.
    assert len(path) <= 2


@given(st.floats(20.0, 120.0), st.floats(-60.0, 60.0), st.floats(-1.2, 1.2), headings)
def test_two_arcs_join_any_pose_ahead(forward, left, angle, heading):
    start = Pose2(-4.0, 7.0, heading)
    end = start.moved(forward, left).turned(angle)
    path = two_arcs(start, end)
    assert_joins(path, start, end)
    assert length_m(path) < 3 * math.hypot(forward, left)


@pytest.mark.parametrize("curvature", [2e-10, -3e-12, 1e-300])
def test_an_arc_that_is_almost_a_line_keeps_its_digits(curvature):
    end = Piece(Pose2(0.0, 0.0, 0.0), 90.0, curvature).end
    assert end.x == pytest.approx(90.0, abs=1e-12)
    # The sagitta of a flat arc.
    assert end.y == pytest.approx(curvature * 90.0**2 / 2.0, rel=1e-9)


@given(st.floats(20.0, 120.0), st.floats(-60.0, 60.0), st.floats(-1.2, 1.2))
def test_a_connection_joins_any_pose_ahead(forward, left, angle):
    start = Pose2(0.0, 0.0, 0.3)
    end = start.moved(forward, left).turned(angle)
    assert_joins(connect(start, end), start, end)


def test_a_connection_straight_ahead_is_one_line():
    start = Pose2(1.0, 2.0, 0.7)
    (line,) = connect(start, start.moved(12.0, 0.0))
    assert (line.length_m, line.curvature_per_m) == (pytest.approx(12.0), 0.0)


@given(st.floats(30.0, 200.0), st.floats(30.0, 200.0), st.floats(1.0, 25.0))
def test_a_bend_is_as_long_as_its_legs_less_the_cut_corner(first, second, radius):
    path = through(((0.0, 0.0), (first, 0.0), (first, second)), radius)
    assert_smooth(path)
    end = path[-1].end
    assert (end.x, end.y) == pytest.approx((first, second), abs=1e-6)
    assert length_m(path) == pytest.approx(first + second - (2 - math.pi / 2) * radius)


def test_a_leg_too_short_for_its_bend_is_refused():
    with pytest.raises(ValueError, match="too short"):
        through(((0.0, 0.0), (5.0, 0.0), (5.0, 50.0)), 10.0)


@given(st.floats(0.0, 95.0), st.floats(-8.0, 8.0))
def test_a_place_beside_a_line_has_the_station_and_offset_it_was_made_from(s_m, left_m):
    place = pose_at(S_CURVE, s_m).moved(0.0, left_m)
    found = project(S_CURVE, place.point)
    assert found is not None
    assume(abs(found[1]) > abs(left_m) - 1e-6)  # another piece may lie nearer
    assert found == (pytest.approx(s_m, abs=1e-6), pytest.approx(left_m, abs=1e-6))


def test_a_place_beyond_both_ends_is_beside_nothing():
    assert project(S_CURVE[:1], S_CURVE[0].start.moved(-1.0, 0.5).point) is None


@given(st.floats(0.0, 40.0), st.floats(50.0, 95.0))
def test_a_cut_runs_from_its_begin_to_its_end(begin, end):
    part = cut(S_CURVE, begin, end)
    assert_smooth(part)
    assert length_m(part) == pytest.approx(end - begin, abs=2e-6)
    assert math.dist(part[0].start.point, pose_at(S_CURVE, begin).point) < 2e-6
    assert math.dist(part[-1].end.point, pose_at(S_CURVE, end).point) < 2e-6


@given(st.floats(-8.0, 8.0))
def test_a_parallel_line_keeps_its_distance_and_stays_smooth(left):
    beside = offset(S_CURVE, left)
    assert_smooth(beside)
    for piece in beside:
        found = project(S_CURVE, piece.at(piece.length_m / 2).point)
        assert found is not None
        assert found[1] == pytest.approx(left, abs=1e-6)


def test_a_line_taken_backward_starts_where_it_ended():
    back = backward(S_CURVE)
    assert_smooth(back)
    assert back[0].start.point == pytest.approx(S_CURVE[-1].end.point)
    assert back[-1].end.point == pytest.approx(S_CURVE[0].start.point)
    assert length_m(back) == pytest.approx(length_m(S_CURVE))
