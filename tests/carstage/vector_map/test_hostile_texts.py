"""OpenDRIVE texts as an attacker or a broken exporter writes them: refused in words, or read."""

from __future__ import annotations

import re

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies

import small_maps
from carstage.errors import VectorMapError
from carstage.vector_map import building, document, vector_map

PLAIN = small_maps.one_road()
LIT = small_maps.document(
    small_maps.road(1, 0, 0, 0, 200, signals=small_maps.light(7, 190, (-1, -1)))
)


def changed(old: str, new: str, text: str = PLAIN) -> str:
    assert old in text, old
    return text.replace(old, new)


BOMB = '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><OpenDRIVE>&b;</OpenDRIVE>'
REFUSED = {
    "nothing": ("", "no well-formed XML"),
    "no XML": ("{}", "no well-formed XML"),
    "cut": (PLAIN[:-40], "no well-formed XML"),
    "half a character": ("<OpenDRIVE>\ud800</OpenDRIVE>", "surrogates not allowed"),
    "another root": ("<svg/>", "its root is <svg>"),
    "a prefix": ('<x:OpenDRIVE xmlns:x="http://x"/>', "its root is <{http://x}OpenDRIVE>"),
    "entities": (BOMB, "DOCTYPE or entities"),
    "deep": ("<OpenDRIVE>" + "<a>" * 5000 + "</a>" * 5000 + "</OpenDRIVE>", "no well-formed XML"),
    "one road twice": (
        small_maps.document(small_maps.road(1, 0, 0, 0, 9), small_maps.road(1, 9, 0, 0, 9)),
        "road 1: two roads have this id",
    ),
    "a word as an id": (changed(' id="1" ', ' id="main" '), 'id="main" of <road>'),
    "an endless road": (changed('length="200"', 'length="1e9"'), 'length="1e9" of <road>'),
    "a long way": (changed('length="200" id', 'length="inf" id'), 'length="inf" of <road>'),
    "no course": (changed("<line/>", ""), "none of line, arc"),
    "no geometry": (re.sub("<planView>.*</planView>", "<planView/>", PLAIN), "no <geometry>"),
    "not a number": (changed('x="0"', 'x="nan"'), 'x="nan" of <geometry>'),
    "far away": (changed('x="0"', 'x="1e7"'), 'x="1e7" of <geometry>'),
    "a needle": (changed("<line/>", '<arc curvature="50"/>'), 'curvature="50" of <arc>'),
    "a coil": (changed("<line/>", '<arc curvature="9"/>'), "turns by 1800 radians"),
    "a broad lane": (changed('a="3.5"', 'a="9000"'), "lane is 9000 m wide"),
    "a steep hill": (
        small_maps.document(small_maps.road(1, 0, 0, 0, 200, elevation=((0, 0, 0, 0, 1e9),))),
        "beyond 1000 km",
    ),
    "beyond numbers": (changed(' d="0"', ' d="1e29"'), "is beyond 1000 km"),
    "a lane twice": (changed('id="-1"', 'id="1"'), "a second lane 1, or it is on the wrong side"),
    "sections backwards": (
        changed("</laneSection>", '</laneSection><laneSection s="-5"/>'),
        "not in the order",
    ),
    "a validity of words": (changed('fromLane="-1"', 'fromLane="all"', LIT), 'fromLane="all"'),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_no_map_can_be_made_of_is_refused_with_its_place_and_a_way_out(name: str) -> None:
    text, reason = REFUSED[name]
    with pytest.raises(VectorMapError) as caught:
        vector_map(text)
    assert reason in caught.value.message
    assert len(caught.value.message) < 400
    assert "labels.vector_map" in caught.value.hint


def test_more_than_a_town_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(document, "LARGEST_TEXT_BYTES", len(PLAIN))
    vector_map(PLAIN)
    with pytest.raises(VectorMapError, match="bytes are more than"):
        vector_map(f"{PLAIN} ")
    monkeypatch.setattr(document, "MOST_ROADS", 0)
    with pytest.raises(VectorMapError, match="more than 0 roads"):
        vector_map(PLAIN)
    monkeypatch.setattr(document, "MOST_ROADS", 5)
    monkeypatch.setattr(document, "MOST_LANES", 0)
    with pytest.raises(VectorMapError, match="1 lanes on one side are more than 0"):
        vector_map(PLAIN)
    monkeypatch.setattr(document, "MOST_LANES", 5)
    monkeypatch.setattr(building, "MOST_POINTS", 3)
    with pytest.raises(VectorMapError, match="more than 3 points"):
        vector_map(PLAIN)


@pytest.mark.parametrize(
    "text",
    [
        PLAIN.replace(
            "<link/>", '<link><successor elementType="road" elementId="99" id="-9"/></link>'
        ),
        PLAIN.replace(
            "<link/>", '<link><successor elementType="junction" elementId="1" id="-1"/></link>'
        ),
        changed("</OpenDRIVE>", '<junction id="5"><connection id="0"/></junction></OpenDRIVE>'),
        changed('type="solid"', 'type="&lt;script&gt;"'),
        changed(
            '<validity fromLane="-1" toLane="-1"/>', '<validity fromLane="3" toLane="9"/>', LIT
        ),
        changed("<lanes>", '<lanes><laneOffset s="900" a="3" b="0" c="0" d="0"/>'),
        changed('<laneSection s="0">', '<laneSection s="0"></laneSection><laneSection s="0">'),
    ],
    ids=["road", "no junction", "junction", "script", "validity", "offset", "empty section"],
)
def test_what_leads_nowhere_leads_nowhere(text: str) -> None:
    town = vector_map(text)
    lanes = set(town.lane_by_id)
    assert lanes
    for lane in town.lanes:
        assert set(lane.successors) | set(lane.predecessors) <= lanes
    assert all(set(signal.lanes) <= lanes for signal in town.signals)


@hypothesis.settings(max_examples=60)
@hypothesis.given(
    strategies.lists(
        strategies.tuples(
            strategies.integers(0, 10_000),
            strategies.sampled_from(
                ["1e30", "-1e30", "nan", "-1", "", "0", "1e-9", "99999999999999999999", "x"]
            ),
        ),
        min_size=1,
        max_size=3,
    )
)
def test_any_values_of_attributes_are_read_or_refused(changes: list[tuple[int, str]]) -> None:
    parts = re.split(r'("[^"]*")', LIT)
    places = range(1, len(parts), 2)
    for at, value in changes:
        parts[places[at % len(places)]] = f'"{value}"'
    try:
        town = vector_map("".join(parts))
    except VectorMapError:
        return
    for lane in town.lanes:
        assert np.isfinite(lane.centre_line).all()
        assert np.abs(lane.centre_line).max() <= document.FARTHEST_M
