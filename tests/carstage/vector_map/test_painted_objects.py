"""Arrows, words, lines and areas that a map has as objects on its roads."""

from __future__ import annotations

import numpy as np
import pytest

import small_maps
from carstage.vector_map import PaintedObject, VectorMap, vector_map


def town_with(*objects: str) -> VectorMap:
    return vector_map(
        small_maps.document(small_maps.road(1, 0, 0, 0, 200, objects="".join(objects)))
    )


def stencil(
    name: str, *, s: float = 100.0, t: float = -1.75, hdg: float = 0.0, more: str = ""
) -> str:
    return (
        f'<object id="7" name="{name}" type="-1" s="{s}" t="{t}" zOffset="0" hdg="{hdg}" '
        f'width="1.2" length="4" {more}/>'
    )


def only(town: VectorMap) -> PaintedObject:
    (found,) = town.painted_objects
    return found


@pytest.mark.parametrize(
    ("name", "ways"),
    [
        ("Stencil_ArrowType1Medium", "straight"),
        ("Stencil_ArrowType4L", "left"),
        ("Stencil_ArrowType4R", "right"),
        ("Stencil_ArrowType7R", "straight right"),
        ("Stencil_ArrowType8", "left straight right"),
        ("Stencil_ArrowType3B", ""),
    ],
)
def test_roadrunner_s_arrows_lead_where_their_type_says(name: str, ways: str) -> None:
    found = only(town_with(stencil(name)))
    assert (found.type, found.subtype, found.colour, found.name) == ("arrow", ways, "white", name)
    assert (found.id, found.road_id, found.lanes) == ("7", 1, ("1/0/-1",))


def test_an_arrow_by_the_standard_says_its_ways_in_its_subtype() -> None:
    text = stencil("any", more='subtype="arrowStraightLeft"').replace(
        'type="-1"', 'type="roadMark"'
    )
    found = only(town_with(text))
    assert (found.type, found.subtype) == ("arrow", "left straight")


@pytest.mark.parametrize("sides", [("1.2", "4"), ("4", "1.2")])
def test_an_arrow_is_longer_than_wide_in_whichever_order_its_sides_are(
    sides: tuple[str, str],
) -> None:
    width, length = sides
    text = stencil("Stencil_ArrowType1").replace(
        'width="1.2" length="4"', f'width="{width}" length="{length}"'
    )
    outline = only(town_with(text)).outline
    assert outline[0].tolist() == outline[-1].tolist()
    assert outline[:, 0].min(), outline[:, 0].max() == (98.0, 102.0)
    np.testing.assert_allclose([outline[:, 1].min(), outline[:, 1].max()], [1.15, 2.35])


def test_a_turned_arrow_of_the_other_lane_lies_on_that_lane() -> None:
    found = only(town_with(stencil("Stencil_ArrowType4L", t=1.75, hdg=np.pi)))
    assert found.lanes == ("1/0/1",)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("Stencil_STOP", ("text", "STOP")),
        ("Stencil_SpeedLimit_30", ("text", "SpeedLimit_30")),
        ("ChevronRegion", ("region", "chevron")),
        ("CrosshatchRegion", ("region", "crosshatch")),
    ],
)
def test_words_and_areas_have_their_names(name: str, kind: tuple[str, str]) -> None:
    found = only(town_with(stencil(name)))
    assert (found.type, found.subtype) == kind


def test_a_line_gets_the_width_of_paint() -> None:
    corners = "".join(f'<cornerLocal u="{u}" v="0" z="0"/>' for u in (-5, 0, 0, 5))
    text = (
        '<object id="7" name="DashedSingleYellow" type="-1" s="100" t="-1.75" hdg="0" width="0" '
        f'length="10"><outline>{corners}</outline></object>'
    )
    found = only(town_with(text))
    assert (found.type, found.subtype, found.colour) == ("line", "broken", "yellow")
    assert (found.outline[:, 0].min(), found.outline[:, 0].max()) == (95.0, 105.0)
    np.testing.assert_allclose(np.unique(found.outline[:, 1]), [1.6875, 1.8125])


@pytest.mark.parametrize(
    "name", ["StopLine", "SimpleCrosswalk", "Speed_30", "SignPost_10ft", "GuardRail"]
)
def test_what_is_not_painted_or_read_elsewhere_is_left_out(name: str) -> None:
    assert town_with(stencil(name)).painted_objects == ()


def test_an_arrow_without_a_size_is_left_out() -> None:
    text = stencil("Stencil_ArrowType1").replace('width="1.2"', 'width="0"')
    assert town_with(text).painted_objects == ()
