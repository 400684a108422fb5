"""How far streets end from the middle of their crossing."""

from __future__ import annotations

import math

import pytest

from carstage_sim.maps.writer.arms import Side, Stub, setbacks, street_side
from carstage_sim.maps.writer.plan import StreetProfile

NARROW = Side(1, 3.5, 0.5, 2, 4.0)
WIDE = Side(2, 3.5, 0.5, 3, 4.0)


def stub(degrees: float, side: Side) -> Stub:
    return Stub(math.radians(degrees), side, side)


def test_at_right_angles_an_arm_ends_a_corner_radius_before_the_crossing_kerb():
    found = setbacks([stub(0, NARROW), stub(90, WIDE), stub(180, NARROW), stub(270, WIDE)], 8.0)
    assert found == pytest.approx([15.5, 12.0, 15.5, 12.0])


def test_the_sharper_two_arms_meet_the_further_away_they_end():
    right, sharp = (setbacks([stub(0, NARROW), stub(d, NARROW)], 8.0)[0] for d in (90, 60))
    assert sharp > right + 3.0


def test_arms_opposite_each_other_leave_room_for_the_paths_between_them():
    assert setbacks([stub(0, NARROW), stub(180, NARROW)], 8.0) == [8.0, 8.0]


def test_arms_that_meet_too_sharply_are_refused():
    with pytest.raises(ValueError, match="25 degrees"):
        setbacks([stub(0, NARROW), stub(25, NARROW)], 8.0)


def test_a_bicycle_lane_lies_between_driving_lane_and_kerb():
    side = street_side(StreetProfile(lanes=1, speed_limit_kmh=50, biking_width_m=1.6))
    assert side.kerb_m == pytest.approx(3.5 + 1.6 + 0.5)
    assert side.gutter_lane == 3
