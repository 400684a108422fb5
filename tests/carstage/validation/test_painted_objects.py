"""Each way in which a stored map's features may differ from those of the OpenDRIVE text."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import small_maps
from carstage.validation.checks.vector_maps import _apart_m, _loose_ends, _other
from carstage.vector_map import vector_map
from carstage.vector_map.model import Lane, SpeedLimit

ARROW = (
    '<object id="7" name="Stencil_ArrowType4R" type="-1" s="100" t="-1.75" hdg="0" width="1.2" '
    'length="3"/>'
)
MADE = vector_map(small_maps.document(small_maps.road(1, 0, 0, 0, 200, objects=ARROW)))
LIT = vector_map(
    small_maps.document(small_maps.road(1, 0, 0, 0, 200, signals=small_maps.light(5, 90, (-1, -1))))
)
HILL = vector_map(small_maps.hill_road())
OTHERWISE = "is not what the OpenDRIVE text says"
ELSEWHERE = "is not where the OpenDRIVE text puts it"


def test_what_the_text_says_is_no_difference() -> None:
    assert _other(MADE, MADE) is None
    assert _loose_ends(MADE) is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"subtype": "left"}, "painted object 7 is not what the OpenDRIVE text says"),
        ({"colour": "yellow"}, "painted object 7 is not what the OpenDRIVE text says"),
        ({"id": "8"}, "its painted objects are not those of the OpenDRIVE text"),
        (
            {"outline": MADE.painted_objects[0].outline + 0.1},
            "painted object 7 is not where the OpenDRIVE text puts it",
        ),
    ],
)
def test_a_changed_arrow_is_found(changes: dict[str, Any], message: str) -> None:
    changed = replace(MADE.painted_objects[0], **changes)
    assert _other(replace(MADE, painted_objects=(changed,)), MADE) == message


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        ("lanes", {"left_neighbour": None}, OTHERWISE),
        ("lanes", {"speed_limits": (SpeedLimit(0.0, 9.0),)}, OTHERWISE),
        ("lanes", {"junction_id": 3}, OTHERWISE),
        ("markings", {"lanes": ()}, OTHERWISE),
        ("markings", {"line": LIT.markings[0].line + 0.1}, ELSEWHERE),
        ("markings", {"s_m": LIT.markings[0].s_m + 1.0}, ELSEWHERE),
        ("stop_lines", {"signals": ()}, OTHERWISE),
        ("stop_lines", {"lanes": ()}, OTHERWISE),
        ("signals", {"type": "206"}, OTHERWISE),
        ("signals", {"lanes": ()}, OTHERWISE),
        ("signals", {"dynamic": False}, OTHERWISE),
        ("signals", {"place": LIT.signals[0].place + 0.1}, ELSEWHERE),
    ],
)
def test_a_changed_feature_is_found(kind: str, changes: dict[str, Any], message: str) -> None:
    first, *others = getattr(LIT, kind)
    changed = replace(LIT, **{kind: (replace(first, **changes), *others)})
    assert _other(LIT, LIT) is None
    assert _other(changed, LIT) == f"{kind.replace('_', ' ')[:-1]} {first.id} {message}"


@pytest.mark.parametrize("kept", [[0, -1], [0, 1, 2]])
def test_a_lane_that_lost_points_is_found(kept: list[int]) -> None:
    lane, *others = HILL.lanes
    arrays = {
        name: value[kept]
        for name in lane.__slots__
        if isinstance(value := getattr(lane, name), np.ndarray)
    }
    changed = replace(HILL, lanes=(replace(lane, **arrays), *others))
    assert _other(changed, HILL) == f"lane {lane.id} {ELSEWHERE}"


def test_a_lane_that_is_not_there_is_found() -> None:
    changed = replace(MADE.painted_objects[0], lanes=("9/0/1",))
    found = _loose_ends(replace(MADE, painted_objects=(changed,)))
    assert found == "painted object 7 names a lane that is not there"


def test_a_lane_without_length_is_where_it_is() -> None:
    ends = np.array([[0.0, 0.0, 0.1], [1.7, 0.2, 0.1]])
    lane = Lane(
        "575/1/-3", 575, 1, -3, None, "driving", "forward", ends, ends, ends, np.full(2, 34.62),
        np.array([0.0, 3.5]),
    )  # fmt: skip
    assert _apart_m(lane, lane) == 0.0
    assert _apart_m(lane, replace(lane, centre_line=ends + 0.5)) == pytest.approx(0.5)
    assert _apart_m(lane, replace(lane, width_m=lane.width_m + 0.25)) == 0.25


def test_a_lane_without_numbers_is_nowhere() -> None:
    lane, *others = HILL.lanes
    changed = replace(HILL, lanes=(replace(lane, width_m=lane.width_m * np.nan), *others))
    assert _other(changed, HILL) == f"lane {lane.id} {ELSEWHERE}"
