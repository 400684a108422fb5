"""Each way in which stored arrows may differ from those of the OpenDRIVE text."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

import small_maps
from carstage.validation.checks.vector_maps import _loose_ends, _other
from carstage.vector_map import vector_map

ARROW = (
    '<object id="7" name="Stencil_ArrowType4R" type="-1" s="100" t="-1.75" hdg="0" width="1.2" '
    'length="3"/>'
)
MADE = vector_map(small_maps.document(small_maps.road(1, 0, 0, 0, 200, objects=ARROW)))


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
            "painted object 7 is not where the text puts it",
        ),
    ],
)
def test_a_changed_arrow_is_found(changes: dict[str, Any], message: str) -> None:
    changed = replace(MADE.painted_objects[0], **changes)
    assert _other(replace(MADE, painted_objects=(changed,)), MADE) == message


def test_a_lane_that_is_not_there_is_found() -> None:
    changed = replace(MADE.painted_objects[0], lanes=("9/0/1",))
    found = _loose_ends(replace(MADE, painted_objects=(changed,)))
    assert found == "painted object 7 names a lane that is not there"
