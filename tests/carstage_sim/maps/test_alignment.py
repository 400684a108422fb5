"""Reference lines: lines and arcs that meet smoothly and end where they should."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from carstage_sim.maps.alignment import Pose2, length_m, through, turn, turning

lengths = st.floats(1.0, 60.0)


def assert_smooth(alignment):
    for before, after in pairwise(alignment):
        assert math.dist((before.end.x, before.end.y), (after.start.x, after.start.y)) < 1e-9
        assert math.remainder(before.end.heading_rad - after.start.heading_rad, math.tau) == (
            pytest.approx(0.0, abs=1e-9)
        )


@given(lengths, lengths, st.sampled_from([-1.0, 1.0]), st.floats(-3.0, 3.0))
def test_a_turn_reaches_its_end_pose(forward, sideways, side, heading):
    start = Pose2(3.0, -2.0, heading)
    knee = start.moved(forward, side * sideways)
    end = Pose2(knee.x, knee.y, heading + side * math.pi / 2)
    path = turn(start, end)
    assert_smooth(path)
    assert math.dist((path[-1].end.x, path[-1].end.y), (end.x, end.y)) < 1e-6
    assert turning(path) == ("left" if side > 0 else "right")


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
