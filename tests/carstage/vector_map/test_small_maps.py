"""What single features of OpenDRIVE become; each map is about one of them."""

from __future__ import annotations

import re

import carla
import numpy as np
import pytest

import small_maps
from carstage.vector_map import VectorMap, vector_map

WIDTH = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'


def changed(text: str, *pairs: tuple[str, str]) -> VectorMap:
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new)
    return vector_map(text)


def test_a_plain_road_has_two_lanes_that_run_against_each_other() -> None:
    town = vector_map(small_maps.one_road())
    right, left = (town.lane_by_id[name] for name in ("1/0/-1", "1/0/1"))
    assert (right.direction, left.direction) == ("forward", "backward")
    assert right.centre_line.tolist() == [[0, 1.75, 0], [200, 1.75, 0]]  # y is to the south
    assert left.centre_line.tolist() == [[200, -1.75, 0], [0, -1.75, 0]]
    assert left.left_boundary.tolist() == [[200, 0, 0], [0, 0, 0]]
    assert left.s_m.tolist() == [200, 0]
    assert (right.left_neighbour, right.right_neighbour) == ("1/0/1", None)
    assert (left.left_neighbour, left.right_neighbour) == ("1/0/-1", None)
    assert right.right_markings == ("1/0/-1/0",)
    assert town.marking_by_id["1/0/-1/0"].line[:, 1].tolist() == [3.5, 3.5]
    assert right.left_markings == ()  # the middle has none


def test_where_one_drives_on_the_left_lanes_run_the_other_way() -> None:
    town = changed(small_maps.one_road(), ('<road name=""', '<road rule="LHT" name=""'))
    right, left = (town.lane_by_id[name] for name in ("1/0/-1", "1/0/1"))
    assert (right.direction, left.direction) == ("backward", "forward")
    assert left.centre_line[:, 0].tolist() == [0, 200]
    assert left.left_boundary[:, 1].tolist() == [-3.5, -3.5]
    assert left.left_markings == ("1/0/1/0",)
    assert right.left_markings == ("1/0/-1/0",)


def test_a_marking_changes_along_its_lane() -> None:
    solid = '<roadMark sOffset="0" type="solid" color="white" width="0.15"/>'
    parts = (
        '<roadMark sOffset="0" type="broken" color="yellow" width="0.1" laneChange="increase"/>'
        '<roadMark sOffset="50" type="none"/>'
        '<roadMark sOffset="120" type="Solid Solid" color="Standard" width="0.2"/>'
        '<roadMark sOffset="180" type="wavy" color="mauve"/>'
    )
    town = changed(small_maps.one_road(), (solid, parts))
    names = town.lane_by_id["1/0/-1"].right_markings
    found = [town.marking_by_id[name] for name in names]
    assert [(m.type, m.colour, m.width_m, m.lane_change, *m.s_m) for m in found] == [
        ("broken", "yellow", 0.1, "increase", 0, 50),
        ("solid solid", "white", 0.2, "both", 120, 180),
        ("other", "other", 0, "both", 180, 200),
    ]
    assert found[1].line[[0, -1], 0].tolist() == [120, 180]


def test_lanes_of_borders_lie_between_them() -> None:
    border = '<border sOffset="0" a="{}3.5" b="0" c="0" d="0"/>'
    text = small_maps.one_road()
    before, _, after = text.partition(WIDTH)
    text = before + border.format("") + after.replace(WIDTH, border.format("-"))
    town = vector_map(text)
    assert town.lane_by_id["1/0/-1"].right_boundary[:, 1].tolist() == [3.5, 3.5]
    assert town.lane_by_id["1/0/1"].right_boundary[:, 1].tolist() == [-3.5, -3.5]


def test_a_raised_lane_lies_above_its_road() -> None:
    high = f'{WIDTH}<height sOffset="0" inner="0.1" outer="0.3"/>'
    town = changed(small_maps.one_road(), (WIDTH, high))
    lane = town.lane_by_id["1/0/-1"]
    assert lane.left_boundary[:, 2].tolist() == [0.1, 0.1]
    assert lane.right_boundary[:, 2].tolist() == [0.3, 0.3]
    assert lane.centre_line[:, 2].tolist() == [0.2, 0.2]


def test_a_jump_of_the_lane_offset_does_not_reach_back_into_the_section_before() -> None:
    section = small_maps.one_road().partition("<laneSection")[2].partition("</laneSection>")[0]
    offsets = (
        '<laneOffset s="0" a="0" b="0" c="0" d="0"/><laneOffset s="80" a="2" b="0" c="0" d="0"/>'
    )
    again = section.replace('s="0"', 's="80"', 1)
    town = changed(
        small_maps.one_road(),
        ("<lanes>", f"<lanes>{offsets}"),
        ("</laneSection>", f"</laneSection><laneSection{again}</laneSection>"),
    )
    assert town.lane_by_id["1/0/-1"].centre_line.tolist() == [[0, 1.75, 0], [80, 1.75, 0]]
    assert town.lane_by_id["1/1/-1"].centre_line.tolist() == [[80, -0.25, 0], [200, -0.25, 0]]


def test_hills_are_followed() -> None:
    lane = vector_map(small_maps.hill_road()).lane_by_id["1/0/-1"]
    u = np.clip((lane.s_m - 50) / 100, 0, 1)
    assert lane.centre_line[:, 2] == pytest.approx(6 * (3 * u**2 - 2 * u**3), abs=1e-4)
    assert 8 < len(lane.s_m) < 60


@pytest.mark.parametrize(
    ("attributes", "limit"),
    [
        ('max="30" unit="km/h"', 30 / 3.6),
        ('max="30" unit="mph"', 13.4112),
        ('max="12.5"', 12.5),
        ('max="no limit"', None),
    ],
)
def test_a_speed_limit_is_the_road_s_unless_the_lane_has_its_own(
    attributes: str, limit: float | None
) -> None:
    kind = f'<type s="0" type="town"><speed {attributes}/></type><type s="90" type="rural"/>'
    own = f'{WIDTH}<speed sOffset="100" max="5" unit="m/s"/>'
    text = small_maps.one_road().replace("<planView>", f"{kind}<planView>")
    before, _, after = text.partition(WIDTH)
    town = vector_map(before + own + after)  # of the left lane
    (found,) = town.lane_by_id["1/0/-1"].speed_limits
    assert found.s_m == 0
    assert found.limit_m_s == (None if limit is None else pytest.approx(limit, abs=1e-4))
    assert [(one.s_m, one.limit_m_s) for one in town.lane_by_id["1/0/1"].speed_limits] == [(100, 5)]


def test_a_light_before_the_end_of_a_road_stops_its_lanes_there() -> None:
    light = small_maps.light(7, 190, (-1, -1))
    controllers = '<controller id="c1" name=""><control signalId="7" type=""/></controller>'
    road = small_maps.road(1, 0, 0, 0, 200, signals=light)
    town = vector_map(small_maps.document(road, controllers=controllers))
    (signal,), (stop,) = town.signals, town.stop_lines
    assert (signal.lanes, signal.controllers, signal.dynamic) == (("1/0/-1",), ("c1",), True)
    assert signal.place.tolist() == [190, 6, 0]
    assert (stop.lanes, stop.signals, stop.source) == (("1/0/-1",), ("7",), "signal")
    assert stop.line.tolist() == [[190, 0, 0], [190, 3.5, 0]]


def test_a_signal_may_stand_elsewhere_than_where_it_applies() -> None:
    position = '<positionInertial x="205" y="-9" z="3" hdg="0.3"/>'
    light = small_maps.light(7, 190, (-1, -1)).replace("</signal>", f"{position}</signal>")
    text = small_maps.document(small_maps.road(1, 0, 0, 0, 200, signals=light))
    town = vector_map(text)
    (signal,), (stop,) = town.signals, town.stop_lines
    assert signal.place.tolist() == [205, 9, 3]
    assert stop.line.tolist() == [[190, 0, 0], [190, 3.5, 0]]
    (landmark,) = carla.Map("Elsewhere", text).get_all_landmarks()
    there = landmark.transform.location
    # The client moves lights by 0.25 m.
    assert signal.place == pytest.approx([there.x, there.y, there.z], abs=0.26)


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
@pytest.mark.parametrize(("orientation", "lanes"), [("+", {1}), ("-", {-1}), ("none", {-1, 1})])
def test_a_signal_without_validity_is_for_the_lanes_that_carla_gives_it(
    orientation: str, lanes: set[int], rule: str
) -> None:
    validity = '<validity fromLane="-1" toLane="-1"/>'
    light = small_maps.light(7, 190, (-1, -1)).replace(validity, "")
    light = light.replace('orientation="+"', f'orientation="{orientation}"')
    kinds = (("driving", 3.5), ("sidewalk", 2.0))
    road = small_maps.road(1, 0, 0, 0, 200, signals=light, lanes=kinds)
    text = small_maps.document(road.replace("<road ", f'<road rule="{rule}" '))
    (signal,) = vector_map(text).signals
    assert set(signal.lanes) == {f"1/0/{lane}" for lane in lanes}
    (landmark,) = carla.Map("Unsaid", text).get_all_landmarks()
    of_the_client = [sorted(pair) for pair in landmark.get_lane_validities()]
    assert lanes == {n for n in (-1, 1) if any(a <= n <= b for a, b in of_the_client)}


@pytest.mark.parametrize("broad", [0.0, 0.4])
def test_a_stop_line_that_is_an_object_ends_the_lanes_below_it(broad: float) -> None:
    stop = (
        f'<object id="9" name="StopLine" type="-1" s="150" t="-1.75" zOffset="0.01" width="{broad}"'
        ' length="3" hdg="1.5707963267948966"><outline>'
        + "".join(
            f'<cornerLocal u="{u}" v="{v}" z="0"/>'
            for u, v in ((-1.5, -broad / 2), (1.5, -broad / 2), (1.5, broad / 2), (-1.5, broad / 2))
        )
        + "</outline></object>"
    )
    town = vector_map(small_maps.document(small_maps.road(1, 0, 0, 0, 200, objects=stop)))
    (line,) = town.stop_lines
    assert (line.source, line.lanes) == ("object", ("1/0/-1",))
    assert line.line[:, 0] == pytest.approx(150, abs=1e-3)
    assert sorted(line.line[[0, -1], 1].tolist()) == pytest.approx([0.25, 3.25], abs=1e-3)
    assert line.line[:, 2] == pytest.approx(0.01)


@pytest.mark.parametrize("outline", ["", "outline", "outlines", "road"])
def test_a_crosswalk_is_its_outline_or_its_length_and_width(outline: str) -> None:
    corners = "".join(
        f'<cornerLocal u="{u}" v="{v}" z="0.02"/>' for u, v in ((-2, -4), (2, -4), (2, 4), (-2, 4))
    )
    if outline == "road":
        corners = "".join(
            f'<cornerRoad s="{s}" t="{t}" dz="0.02"/>'
            for s, t in ((98, -4), (102, -4), (102, 4), (98, 4))
        )
    shape = f"<outline>{corners}</outline>" if outline else ""
    if outline == "outlines":
        shape = f"<outlines>{shape}</outlines>"
    walk = (
        '<object id="3" name="zebra" type="crosswalk" s="100" t="0" zOffset="0" hdg="0" '
        f'length="4" width="8">{shape}</object>'
    )
    town = vector_map(small_maps.document(small_maps.road(1, 0, 0, 0, 200, objects=walk)))
    (found,) = town.crosswalks
    height = 0.02 if outline else 0
    assert (found.id, found.name, found.road_id) == ("3", "zebra", 1)
    assert found.outline.tolist() == [
        [98, 4, height], [102, 4, height], [102, -4, height], [98, -4, height], [98, 4, height]
    ]  # fmt: skip


def test_a_text_without_roads_is_a_map_without_lanes() -> None:
    assert vector_map(small_maps.document()).lanes == ()


def test_elements_of_asam_s_namespace_are_read_as_carla_reads_them() -> None:
    walk = '<object id="3" type="crosswalk" name="" s="100" t="0" length="4" width="8"/>'
    text = small_maps.document(small_maps.road(1, 0, 0, 0, 200, objects=walk))
    schema = "http://code.asam.net/simulation/standard/opendrive_schema"
    town = changed(
        text,
        ("<OpenDRIVE>", f'<OpenDRIVE xmlns="{schema}" xmlns:x="http://x">'),
        ("</OpenDRIVE>", '<x:road id="2"/></OpenDRIVE>'),
    )
    assert [lane.id for lane in town.lanes] == [lane.id for lane in vector_map(text).lanes]
    assert len(town.crosswalks) == 1


@pytest.mark.parametrize(
    ("program", "left"), [("RoadRunner", "broken solid"), ("x", "solid broken")]
)
def test_strokes_of_double_lines_are_named_from_inside_to_outside(program: str, left: str) -> None:
    """RoadRunner names them from left to right."""
    plain = small_maps.road(1, 0, 0, 0, 90)
    road = re.sub(r'(<roadMark [^>]*type=")[a-z ]+"', r'\1solid broken"', plain)
    assert road != plain
    scene = f'<userData><vectorScene program="{program}"/></userData></header>'
    town = vector_map(small_maps.document(road).replace("</header>", scene))
    kinds = {mark.lane: mark.type for mark in town.markings}
    assert (kinds[1], kinds[-1]) == (left, "solid broken")
