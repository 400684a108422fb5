"""OpenDRIVE documents as an attacker, a broken exporter or a tired person writes them.

Each becomes a town of finite places, or is refused in words that name the map; nothing crashes,
nothing takes for long, and nothing stays in the cache of what was refused.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import small_maps
from carstage_sim.maps import BakeOptions, MapSamplingError
from carstage_sim.maps.checking import FARTHEST_M, HIGHEST_M
from carstage_sim.maps.loading import town_from_opendrive

PLAIN = small_maps.one_road()
LIGHT = small_maps.light(7, 190, (-1, -1))
LIT = small_maps.document(small_maps.road(1, 0, 0, 0, 200, signals=LIGHT))
WIDTH = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
LANE = f'<lane id="-1" type="driving" level="false"><link/>{WIDTH}</lane>'
CENTRE = '<center><lane id="0" type="none" level="false"/></center>'
NO_LANE = "no lane of type driving"
READER = "CARLA's own reader gives up"
BEYOND = "beyond 1000 km or 10 km of height"


def changed(old: str, new: str, text: str = PLAIN) -> str:
    assert old in text, old
    return text.replace(old, new)


def course(shape: str) -> str:
    return changed("<line/>", shape)


def sections(*parts: str) -> str:
    before, _, after = PLAIN.partition("<laneSection")
    return before + "".join(parts) + "</lanes>" + after.partition("</lanes>")[2]


def section(s: object = 0, lanes: str = LANE, centre: str = CENTRE) -> str:
    return f'<laneSection s="{s}">{centre}<right>{lanes}</right></laneSection>'


def hill(*profile: tuple[float, float, float, float, float]) -> str:
    return small_maps.document(small_maps.road(1, 0, 0, 0, 200, elevation=profile))


def linked(link: str) -> str:
    return PLAIN.replace("<link/>", f"<link>{link}</link>", 1)


def two(first: str, second: str = "") -> str:
    """Two roads in a row."""
    roads = [small_maps.road(1, 0, 0, 0, 100), small_maps.road(2, 100, 0, 0, 100)]
    return small_maps.document(
        *(
            road.replace("<link/>", f"<link>{link}</link>", 1)
            for road, link in zip(roads, (first, second), strict=True)
        )
    )


def ended(*more: str) -> str:
    return changed("</OpenDRIVE>", "".join(more) + "</OpenDRIVE>")


def junction(connecting: object, name: object = 5) -> str:
    return (
        f'<junction id="{name}" name=""><connection id="0" incomingRoad="1" contactPoint="start" '
        f'connectingRoad="{connecting}"><laneLink from="-1" to="-1"/></connection></junction>'
    )


def signal(old: str, new: str) -> str:
    return changed(old, new, LIT)


def crosswalk(*corners: tuple[float, float], s: float = 50, heading: str = "0") -> str:
    outline = "".join(f'<cornerLocal u="{u}" v="{v}" z="0"/>' for u, v in corners)
    drawn = (
        f'<object id="1" name="c" type="crosswalk" s="{s}" t="0" zOffset="0" hdg="{heading}" '
        f'orientation="none" length="4" width="8"><outline>{outline}</outline></object>'
    )
    return small_maps.document(small_maps.road(1, 0, 0, 0, 200, objects=drawn))


def placed(reference: str) -> str:
    return small_maps.document(small_maps.road(1, 0, 0, 0, 200), geo_reference=reference)


SQUARE = ((-2, -4), (2, -4), (2, 4), (-2, 4), (-2, -4))
NEXT = '<successor elementType="road" elementId="2" contactPoint="start"/>'

REFUSED = {
    "nothing": ("", "no well-formed XML"),
    "zero bytes": ("\0" * 50, "no well-formed XML"),
    "half of it": (PLAIN[: len(PLAIN) // 2], "no well-formed XML"),
    "too deep": (f"<OpenDRIVE>{'<a>' * 3000}{'</a>' * 3000}</OpenDRIVE>", "Excessive depth"),
    "a reference that is no number": (placed("+proj=tmerc +lat_0=abc"), READER),
    "a road of length 0": (changed('length="200"', 'length="0"'), "not above 0"),
    "a road of length 1 nm": (changed('length="200"', 'length="1e-9"'), NO_LANE),
    "an endless road": (changed('length="200"', 'length="inf"'), "is no number"),
    "a decimal comma": (changed('length="200"', 'length="200,5"'), "is no number"),
    "a road without length": (PLAIN.replace(' length="200"', "", 1), "it has no length"),
    "a negative id": (PLAIN.replace('id="1"', 'id="-1"', 1), "none that CARLA reads"),
    "an id of 33 bits": (PLAIN.replace('id="1"', f'id="{2**32 + 1}"', 1), "none that CARLA reads"),
    "a piece that begins late": (
        changed('<geometry s="0"', '<geometry s="150"'),
        "pieces begin at 0",
    ),
    "pieces in disorder": (
        course(
            '<line/></geometry><geometry s="100" x="100" y="0" hdg="0" length="50"><line/>'
            '</geometry><geometry s="50" x="50" y="0" hdg="0" length="50"><line/>'
        ),
        "pieces begin at 0 and follow",
    ),
    "a heading of 1e300": (changed('hdg="0"', 'hdg="1e300"'), "hdg=1e.300 is beyond"),
    "no shape": (course(""), "it has 0 of line, arc"),
    "two shapes": (course("<line/><line/>"), "it has 2 of line, arc"),
    "an unknown shape": (course("<clothoid/>"), "it has 0 of line, arc"),
    "a straight arc": (course('<arc curvature="0"/>'), "write a <line/>"),
    "a pinhead": (course('<arc curvature="1e9"/>'), "a curvature above"),
    "a curvature that is no number": (course('<arc curvature="nan"/>'), "arc: curvature='nan'"),
    "an arc without curvature": (course("<arc/>"), "it has no curvature"),
    "a spiral into a point": (course('<spiral curvStart="0" curvEnd="1e9"/>'), "curvature above"),
    "a spiral that is an arc": (course('<spiral curvStart="1" curvEnd="1"/>'), "or an <arc>"),
    "a cubic that is no number": (course('<poly3 a="nan" b="0" c="0" d="0"/>'), "poly3: a='nan'"),
    "a curve that stands still": (
        course('<paramPoly3 aU="0" bU="0" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>'),
        BEYOND,
    ),
    "a height that is no number": (hill((0, float("nan"), 0, 0, 0)), "elevation: a='nan'"),
    "a road in orbit": (hill((0, 1e9, 0, 0, 0)), BEYOND),
    "a road up to the sky": (hill((0, 0, 0, 0, 1)), r"lane 1, s=\d+.0 m: .*" + BEYOND),
    "a bank that is no number": (
        changed(
            "<lateralProfile/>",
            '<lateralProfile><superelevation s="0" a="inf"/></lateralProfile>',
        ),
        "superelevation: a='inf'",
    ),
    "lanes far from their road": (changed("<lanes>", '<lanes><laneOffset s="0" a="1e7"/>'), BEYOND),
    "an offset that is no number": (
        changed("<lanes>", '<lanes><laneOffset s="0" a="nan"/>'),
        "laneOffset: a='nan'",
    ),
    "lanes without width": (changed('a="3.5"', 'a="0"'), NO_LANE),
    "lanes of negative width": (changed('a="3.5"', 'a="-3.5"'), NO_LANE),
    "lanes of a width in words": (changed('a="3.5"', 'a="wide"'), NO_LANE),
    "a lane as wide as a country": (changed('a="3.5"', 'a="1e6"'), "m wide"),
    "a lane that widens without end": (
        changed('c="0" d="0"/><roadM', 'c="0" d="-1"/><roadM'),
        BEYOND,
    ),
    "a width that is no number": (changed('a="3.5"', 'a="inf"'), "width: a='inf'"),
    "a width from beyond the end": (
        changed('sOffset="0" a="3.5"', 'sOffset="900" a="3.5"'),
        READER,
    ),
    "no sections": (sections(), "no <lanes><laneSection>"),
    "sections in one place": (sections(section(), section()), READER),
    "a section beyond the end": (sections(section(), section(900)), READER),
    "a section before the road": (sections(section(-100)), READER),
    "a section nowhere": (sections(section("nan")), "laneSection: s='nan'"),
    "a section in words": (sections(section("zero")), "laneSection: s='zero'"),
    "a road without a centre": (sections(section(centre="")), READER),
    "a seventh lane without six": (changed('<lane id="-1"', '<lane id="-7"'), READER),
    "a lane of 32 bits": (changed('<lane id="-1"', f'<lane id="{-(2**31) - 1}"'), "a lane's id is"),
    "lanes for flying": (changed('type="driving"', 'type="flying"'), NO_LANE),
    "a lane that leads nowhere": (
        two(NEXT).replace("<link/>", '<link><successor id="-9"/></link>'),
        "it crashes",
    ),
    "a junction into nowhere": (ended(junction(99)), READER),
    "a signal before the road": (signal('s="190"', 's="-5"'), READER),
    "a signal nowhere": (signal('s="190"', 's="nan"'), READER),
    "a reference to no signal": (
        changed("<signals>", '<signals><signalReference s="10" t="0" id="55" orientation="+"/>'),
        "it crashes",
    ),
    "a crosswalk over the continent": (
        crosswalk((-1e8, -1e8), (1e8, -1e8), (1e8, 1e8), (-1e8, -1e8)),
        "a crosswalk: .*" + BEYOND,
    ),
}  # fmt: skip
"""Text, and words of the refusal."""

TAKEN = {
    "two megabytes of name": PLAIN.replace('name=""', f'name="{"x" * 2_000_000}"', 1),
    "three megabytes of comment": changed("<planView>", f"<!--{'x' * 3_000_000}--><planView>"),
    "characters that turn the text around": PLAIN.replace('name=""', 'name="&#x7f;\u202e"', 1),
    "a processing instruction": changed("<planView>", "<?php evil ?><planView>"),
    "a document type from elsewhere": changed(
        "<OpenDRIVE>", '<!DOCTYPE OpenDRIVE SYSTEM "file:///etc/passwd"><OpenDRIVE>'
    ),
    "elements that nobody knows": ended('<userData code="x"/><tunnel/><railroad/>'),
    "no header": PLAIN[: PLAIN.index("<header")] + PLAIN.partition("</header>")[2],
    "a road longer than its course": PLAIN.replace('length="200"', 'length="400"', 1),
    "a course longer than its road": PLAIN.replace('length="200"', 'length="50"', 1),
    "a course that begins before it": changed('<geometry s="0"', '<geometry s="-10"'),
    "two pieces in one place": course(
        '<line/></geometry><geometry s="0" x="0" y="0" hdg="3" length="200"><line/>'
    ),
    "a heading of many turns": changed('hdg="0"', 'hdg="999999"'),
    "a road in circles": course('<arc curvature="2"/>'),
    "a steep cubic": course('<poly3 a="0" b="1e9" c="1e9" d="1e9"/>'),
    "a hasty curve": course(
        '<paramPoly3 pRange="normalized" aU="0" bU="1e12" cU="0" dU="0" '
        'aV="0" bV="1e12" cV="0" dV="0"/>'
    ),
    "a cliff": hill((0, 0, 0, 0, 0), (100, 500, 0, 0, 0)),
    "a wall": hill((0, 0, 49, 0, 0)),
    "a lane as wide as an airport": changed('a="3.5"', 'a="500"'),
    "a width from before the start": changed('sOffset="0" a="3.5"', 'sOffset="-50" a="3.5"'),
    "sections in disorder": sections(section(100), section(0)),
    "five thousand sections": sections(*(section(n * 0.01) for n in range(5000))),
    "two lanes of one number": sections(section(lanes=2 * LANE)),
    "a lane on the wrong side": changed('<lane id="-1"', '<lane id="1"'),
    "four hundred lanes": sections(
        section(lanes="".join(LANE.replace('"-1"', f'"-{n}"') for n in range(1, 400)))
    ),
    "an ultraviolet marking": changed(
        'type="solid" color="white" width="0.15"', 'type="wavy" color="ultraviolet" width="nan"'
    ),
    "a marking as wide as a planet": changed('width="0.15"', 'width="1e9"'),
    "a link to nowhere": linked(NEXT.replace('"2"', '"99"')),
    "a link to itself": linked(NEXT.replace('"2"', '"1"')),
    "a link to no junction": linked('<successor elementType="junction" elementId="77"/>'),
    "a link in words": linked('<successor elementType="road" elementId="north"/>'),
    "a ring of two": two(
        NEXT + '<predecessor elementType="road" elementId="2" contactPoint="end"/>',
        NEXT.replace('"2"', '"1"')
        + '<predecessor elementType="road" elementId="1" contactPoint="end"/>',
    ),
    "a junction with itself": ended(junction(1)),
    "a junction with a name": ended(junction(1, "five")),
    "a junction twice": ended(junction(1), junction(1)),
    "a controller of nothing": ended(
        '<controller id="1" name=""><control signalId="404" type="0"/></controller>'
    ),
    "a signal beyond the end": signal('s="190"', 's="1900"'),
    "a signal far away": signal('t="-6.0"', 't="1e9"'),
    "a signal for four billion lanes": signal(
        'fromLane="-1" toLane="-1"', 'fromLane="-2000000000" toLane="2000000000"'
    ),
    "a signal for lanes in words": signal('fromLane="-1"', 'fromLane="left"'),
    "a signal without id": signal('id="7" ', ""),
    "a signal with a path for an id": signal('id="7"', 'id="&lt;b&gt;../../x&#10;"'),
    "a limit of 1e308": signal('value="-1"', 'value="1e308"').replace("1000001", "274"),
    "a thousand signals": small_maps.document(
        small_maps.road(
            1, 0, 0, 0, 200,
            signals="".join(small_maps.light(n, 190, (-1, -1)) for n in range(1000)),
        )
    ),
    "a crosswalk of one corner": crosswalk((0, 0)),
    "a crosswalk of none": crosswalk(),
    "a crosswalk that turns nowhere": crosswalk(*SQUARE, heading="nan"),
    "a crosswalk beyond the end": crosswalk(*SQUARE, s=5000),
    "a crosswalk across itself": crosswalk((-2, -4), (2, 4), (2, -4), (-2, 4), (-2, -4)),
    "roads on each other": small_maps.document(
        *(small_maps.road(n, 0, 0, 0.001 * n, 200) for n in range(1, 30))
    ),
    "coordinates of a survey": small_maps.document(small_maps.road(1, 691e3, 533e3, 0, 200)),
    "a reference of infinities": placed("+proj=tmerc +lat_0=nan +lon_0=inf"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_no_town_can_be_made_of_is_refused_in_words(what: str, tmp_path: Path) -> None:
    text, words = REFUSED[what]
    with pytest.raises(MapSamplingError, match=words) as caught:
        town_from_opendrive("Odd", text, cache_folder=tmp_path)
    assert str(caught.value).startswith("map Odd")
    assert len(str(caught.value)) < 600
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("what", TAKEN)
def test_what_carla_reads_becomes_a_town_of_finite_places(what: str, tmp_path: Path) -> None:
    town = town_from_opendrive(
        "Odd", TAKEN[what], BakeOptions(scenery=False), cache_folder=tmp_path
    )
    assert len(town.static_mesh.triangles) > 0
    reach = np.array([FARTHEST_M, FARTHEST_M, HIGHEST_M])
    for places in (town.static_mesh.vertices, town.lanes.location, town.spawn_points[:, :3]):
        assert (np.abs(places) <= 1.01 * reach).all()
    assert np.isfinite(town.lanes.speed_limit_kmh).all()
    assert np.isfinite(town.geo_reference).all()
