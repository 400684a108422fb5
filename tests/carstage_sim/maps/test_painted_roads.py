"""What a map paints on its roads lies where OpenDRIVE has it."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from lxml import etree
from shapely.geometry.base import BaseGeometry

import small_maps
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.baking import BakeOptions, bake, sample_in_child
from carstage_sim.maps.levels import station_levels
from carstage_sim.maps.markings import lane_lines, painted_arrows
from carstage_sim.maps.road_objects import arrow, arrow_ways, lane_offset
from carstage_sim.maps.signals import PaintedArrow, signal_plan
from carstage_sim.maps.strips import crosswalks, strips

PLAIN = '<roadMark sOffset="0" type="solid" color="white" width="0.15"/>'
HEADING = 0.5
OFFSET_M = 1.5
LANE_OFFSET = f'<lanes><laneOffset s="0" a="{OFFSET_M}" b="0" c="0" d="0"/>'
ARROW = (
    '<object id="8" name="Stencil_ArrowType4R" type="-1" s="60" t="-0.25" zOffset="0" hdg="0" '
    'width="2.5" length="1.9" orientation="-"/>'
)
WALK = (
    '<object id="7" type="crosswalk" name="walk" s="100" t="0" zOffset="0" hdg="0" length="3" '
    'width="7" orientation="+"><outline>'
    + "".join(
        f'<cornerLocal u="{u}" v="{v}" z="0"/>'
        for u, v in ((-1.5, -3.5), (1.5, -3.5), (1.5, 3.5), (-1.5, 3.5), (-1.5, -3.5))
    )
    + "</outline></object>"
)


def text(objects: str, lane_offset: str = LANE_OFFSET) -> str:
    road = small_maps.road(1, 10, -20, HEADING, 200, objects=objects)
    return small_maps.document(road.replace("<lanes>", lane_offset))


def at(s: float, t: float) -> tuple[float, float]:
    """A place of the road in CARLA's frame."""
    c, sine = math.cos(HEADING), math.sin(HEADING)
    return 10 + s * c - t * sine, -(-20 + s * sine + t * c)


@pytest.fixture(scope="module")
def samples():
    return sample_in_child(text(ARROW + WALK), "painted")


def test_a_crosswalk_lies_where_opendrive_has_it_on_a_road_with_a_lane_offset(samples) -> None:
    found = samples["crosswalk"][:4, :2]
    expected = [at(100 + u, v) for u, v in ((-1.5, -3.5), (1.5, -3.5), (1.5, 3.5), (-1.5, 3.5))]
    np.testing.assert_allclose(found, expected, atol=2e-3)


CORNERS = ((-2, -3), (2, -3), (2, 3), (-2, 3))
LOCAL = [f'<cornerLocal u="{u}" v="{v}" z="0"/>' for u, v in CORNERS]
OF_THE_ROAD = [f'<cornerRoad s="{60 + u}" t="{v}" dz="0" height="0"/>' for u, v in CORNERS]


def walk(s: float, inside: str) -> str:
    return (
        f'<object id="{s}" type="crosswalk" name="walk" s="{s}" t="0" hdg="0" length="4" width="6">'
        f"{inside}</object>"
    )


@pytest.mark.parametrize(
    "inside",
    [
        f"<outline>{''.join(LOCAL)}</outline>",
        f"<outline>{''.join([*LOCAL, LOCAL[0]])}</outline>",
        f"<outlines><outline>{''.join(LOCAL)}</outline></outlines>",
        f"<outline>{''.join(OF_THE_ROAD)}</outline>",
        "",
    ],
    ids=["open", "closed", "in outlines", "along the road", "length and width"],
)
def test_crosswalks_are_found_however_their_outline_is_written(inside: str) -> None:
    closed = walk(100, f"<outline>{''.join([*LOCAL, LOCAL[0]])}</outline>")
    found = crosswalks(sample_in_child(text(walk(60, inside) + closed), "walks"))
    for one, s_m in zip(found, (60, 100), strict=True):
        expected = shapely.Polygon([at(s_m + u, v) for u, v in CORNERS])
        assert one.area.symmetric_difference(expected).area < 0.05


def test_an_arrow_lies_and_points_where_opendrive_has_it(samples) -> None:
    (arrow,) = signal_plan(samples["record"]).arrows
    np.testing.assert_allclose(arrow.location[:2], at(60, -0.25), atol=2e-3)
    assert arrow.yaw_deg == pytest.approx(-math.degrees(HEADING), abs=1e-3)
    assert (arrow.ways, arrow.length_m, arrow.width_m) == (frozenset({"right"}), 2.5, 1.9)


@pytest.mark.parametrize(
    "text_of",
    [
        'name="Stencil_ArrowType1" s="5" t="0" width="nan" length="3"',
        'name="Stencil_ArrowType1" s="5" t="0" width="1" length="1e9"',
        'name="Stencil_ArrowType1" s="5" t="0" width="wide" length="3"',
        'name="Stencil_ArrowType1" s="5" t="0"',
    ],
)
def test_an_arrow_without_a_size_that_can_be_is_left_out(text_of: str) -> None:
    element = etree.fromstring(f"<object {text_of}/>")
    assert arrow(element, lambda s_m: ((0.0, 0.0, 0.0), 0.0)) is None


def test_what_is_painted_lies_where_opendrive_has_it_on_a_road_whose_lanes_swing_out() -> None:
    # A turn lane: 3.5 m over 40 m; then lanes that go on to the left.
    c, d = 3 * 3.5 / 40**2, -2 * 3.5 / 40**3
    swing = (
        f'<lanes><laneOffset s="0" a="0"/><laneOffset s="40" a="0" b="0" c="{c}" d="{d}"/>'
        '<laneOffset s="80" a="3.5"/><laneOffset s="95" a="3.5" b="0.3"/>'
    )
    samples = sample_in_child(text(ARROW + WALK, swing), "swinging")
    (arrow,) = signal_plan(samples["record"]).arrows
    np.testing.assert_allclose(arrow.location[:2], at(60, -0.25), atol=2e-3)
    assert arrow.yaw_deg == pytest.approx(-math.degrees(HEADING), abs=1e-3)
    expected = [at(100 + u, v) for u, v in ((-1.5, -3.5), (1.5, -3.5), (1.5, 3.5), (-1.5, 3.5))]
    np.testing.assert_allclose(samples["crosswalk"][:4, :2], expected, atol=5e-3)


def test_a_lane_offset_in_words_is_none() -> None:
    road = etree.fromstring('<road><lanes><laneOffset s="x" a="nan" b="?"/></lanes></road>')
    assert lane_offset(road, 5.0) == (0.0, 0.0)


def test_an_arrow_with_a_place_that_is_no_number_stands_at_the_begin() -> None:
    attributes = 'name="Stencil_ArrowType1" s="far" t="inf" hdg="?" width="1" length="3"'
    element = etree.fromstring(f"<object {attributes}/>")
    found = arrow(element, lambda s_m: ((s_m, 0.0, 0.0), 0.0))
    assert found is not None
    assert found["location"] == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("ways", [{"left"}, {"straight"}, {"left", "straight", "right"}])
def test_a_painted_arrow_fills_its_rectangle(ways: set[str]) -> None:
    arrow = PaintedArrow(frozenset(ways), (10.0, 5.0, 0.0), 90.0, 4.0, 1.2)
    np.testing.assert_allclose(painted_arrows([arrow]).bounds, (9.4, 3.0, 10.6, 7.0), atol=1e-9)


def test_an_arrow_to_the_right_reaches_to_the_right_at_its_head() -> None:
    area = painted_arrows([PaintedArrow(frozenset({"right"}), (0.0, 0.0, 0.0), 0.0, 2.5, 1.9)])
    # Along x, right is towards positive y.
    head, foot = (area.intersection(shapely.box(x, -2, x + 1, 2)).centroid for x in (0.5, -1.5))
    assert head.y > foot.y + 0.5


def test_the_road_shows_the_arrow_as_a_line() -> None:
    town = bake("Painted", text(ARROW), BakeOptions(scenery=False, navigation=False))
    mesh = town.static_mesh
    lines = mesh.triangles[mesh.tag == CityObjectLabel.ROAD_LINES]
    middles = mesh.vertices[lines].mean(axis=1)[:, :2]
    near = np.linalg.norm(middles - at(60, -0.25), axis=1) < 1.6
    beyond = np.linalg.norm(middles - at(70, -0.25), axis=1) < 1.0
    assert near.sum() >= 5
    assert not beyond.any()


@pytest.mark.parametrize(
    ("attributes", "ways"),
    [
        ('name="Stencil_ArrowType1Short"', ["straight"]),
        ('name="Stencil_ArrowType7L"', ["left", "straight"]),
        ('name="Stencil_ArrowType8"', ["left", "right", "straight"]),
        ('name="Stencil_ArrowType3B"', []),
        ('name="a" subtype="arrowStraightRight"', ["right", "straight"]),
        ('name="Stencil_STOP"', []),
    ],
)
def test_where_an_arrow_leads(attributes: str, ways: list[str]) -> None:
    assert arrow_ways(etree.fromstring(f"<object {attributes}/>")) == ways


def paint(text: str) -> tuple[BaseGeometry, BaseGeometry]:
    """White and yellow lane lines."""
    samples = sample_in_child(text, "lined")
    return lane_lines(strips(samples, station_levels(samples)), ())


def painted_m2(area: BaseGeometry, x0: float, x1: float, y: float, half_m: float = 0.6) -> float:
    return float(area.intersection(shapely.box(x0, y - half_m, x1, y + half_m)).area)


@pytest.mark.parametrize("side", [1, -1])
def test_each_line_of_a_lane_is_painted_where_it_holds(side: int) -> None:
    marks = (
        '<roadMark sOffset="0" type="broken" color="white" width="0.1"/>'
        '<roadMark sOffset="40.3" type="solid" color="white" width="0.2"/>'
        '<roadMark sOffset="70.03" type="none"/>'
        '<roadMark sOffset="90.02" type="solid" color="yellow" width="0.15"/>'
    )
    road = small_maps.road(1, 0, 0, 0, 100).replace(PLAIN, marks)
    white, yellow = paint(small_maps.document(road))
    y = side * 3.5
    assert painted_m2(white, 0, 40.3, y) == pytest.approx(4 * 3 * 0.1, abs=1e-3)
    assert painted_m2(white, 40.3, 70.03, y) == pytest.approx(29.73 * 0.2, abs=1e-3)
    assert painted_m2(white, 70.04, 100, y) == 0.0
    assert painted_m2(yellow, 0, 90.02, y) == pytest.approx(0.0, abs=1e-3)
    assert painted_m2(yellow, 90.02, 100, y) == pytest.approx(9.98 * 0.15, abs=1e-3)


def test_lines_that_change_close_to_each_other_hold_beyond_the_last_change() -> None:
    marks = (
        '<roadMark sOffset="0" type="solid" color="white" width="0.15"/>'
        '<roadMark sOffset="0.03" type="none"/>'
        '<roadMark sOffset="50.5" type="solid" color="white" width="0.15"/>'
        '<roadMark sOffset="50.55" type="none"/>'
    )
    white, _ = paint(small_maps.document(small_maps.road(1, 0, 0, 0, 100).replace(PLAIN, marks)))
    assert white.area < 2 * 0.3 * 0.15


def double(kind: str) -> str:
    return f'<roadMark sOffset="0" type="{kind}" color="white" width="0.1"/>'


SOLID_M2 = pytest.approx(90 * 0.1, abs=1e-3)
BROKEN_M2 = pytest.approx(10 * 3 * 0.1, abs=1e-3)


@pytest.mark.parametrize(
    ("kind", "inner_m2", "outer_m2"),
    [
        ("solid solid", SOLID_M2, SOLID_M2),
        ("solid broken", SOLID_M2, BROKEN_M2),
        ("broken solid", BROKEN_M2, SOLID_M2),
        ("broken broken", BROKEN_M2, BROKEN_M2),
    ],
)
def test_a_double_line_has_the_strokes_of_its_kind_from_inside_to_outside(
    kind: str, inner_m2: object, outer_m2: object
) -> None:
    road = small_maps.road(1, 0, 0, 0, 90).replace(PLAIN, double(kind))
    white, _ = paint(small_maps.document(road))
    for side in (1, -1):
        assert painted_m2(white, 0, 90, side * (3.5 - 0.12), 0.1) == inner_m2
        assert painted_m2(white, 0, 90, side * (3.5 + 0.12), 0.1) == outer_m2


def test_roadrunner_names_the_strokes_of_left_lanes_from_left_to_right() -> None:
    road = small_maps.road(1, 0, 0, 0, 90).replace(PLAIN, double("solid broken"))
    scene = '<userData><vectorScene program="RoadRunner"/></userData></header>'
    white, _ = paint(small_maps.document(road).replace("</header>", scene))
    for side, inner_m2, outer_m2 in ((1, SOLID_M2, BROKEN_M2), (-1, BROKEN_M2, SOLID_M2)):
        assert painted_m2(white, 0, 90, side * (3.5 - 0.12), 0.1) == inner_m2
        assert painted_m2(white, 0, 90, side * (3.5 + 0.12), 0.1) == outer_m2


@pytest.mark.parametrize("sides", ["both", "left", "right"])
def test_a_double_line_in_the_middle_has_its_strokes_from_left_to_right(sides: str) -> None:
    middle = '<lane id="0" type="none" level="false"'
    road = small_maps.road(1, 0, 0, 0, 90).replace(PLAIN, "")
    road = road.replace(f"{middle}/>", f"{middle}>{double('solid broken')}</lane>")
    gone = {"left": "right", "right": "left"}.get(sides)
    if gone:
        road = road[: road.index(f"<{gone}>")] + road[road.index(f"</{gone}>") + len(gone) + 3 :]
    white, _ = paint(small_maps.document(road))
    # Along x, left is towards negative y.
    assert painted_m2(white, 0, 90, -0.12, 0.1) == SOLID_M2
    assert painted_m2(white, 0, 90, 0.12, 0.1) == BROKEN_M2
