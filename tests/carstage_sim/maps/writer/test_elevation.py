"""Heights along a road: through the knots, smooth, never beyond them."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from carstage_sim.maps.writer.elevation import grade, height_m, level, profile

heights = st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=6)


@given(heights)
def test_a_profile_passes_its_knots_and_is_smooth_there(values):
    knots = [(30.0 * i, z) for i, z in enumerate(values)]
    curve = profile(knots)
    for (s, z), piece in zip(knots, curve, strict=False):
        assert height_m(curve, s) == pytest.approx(z)
        assert piece.start_m == s
    for before, after in pairwise(curve):
        s = after.start_m
        assert before.value(s) == pytest.approx(after.value(s), abs=1e-9)
        assert before.slope(s) == pytest.approx(after.slope(s), abs=1e-9)


@given(heights)
def test_a_profile_never_swings_beyond_its_knots(values):
    curve = profile([(30.0 * i, z) for i, z in enumerate(values)])
    for i, (low, high) in enumerate(pairwise(values)):
        for part in (0.1, 0.3, 0.5, 0.7, 0.9):
            z = height_m(curve, 30.0 * (i + part))
            assert min(low, high) - 1e-9 <= z <= max(low, high) + 1e-9


@given(heights)
def test_a_profile_is_level_at_both_ends(values):
    knots = [(30.0 * i, z) for i, z in enumerate(values)]
    curve = profile(knots)
    assert grade(curve, 0.0) == 0.0
    assert grade(curve, knots[-1][0]) == pytest.approx(0.0, abs=1e-9)


def test_between_equal_heights_the_road_is_level():
    curve = profile([(0.0, 1.0), (10.0, 1.0), (60.0, 5.0)])
    assert {height_m(curve, s / 2) for s in range(20)} == {1.0}


def test_a_level_road_has_one_height():
    assert height_m(level(4.5), 123.0) == 4.5
    assert grade(level(4.5), 123.0) == 0.0
