"""The walkers check fails on what it is there to notice."""

from __future__ import annotations

from dataclasses import replace

import carla
import numpy as np
import pytest

from benchmarks.simulator.walkers import WalkableSurface, WalkerFigures, judge

GOOD = WalkerFigures(walkers=10, samples=800, walked=9, alive=10)


def test_walkers_who_keep_to_the_walkable_surface_pass() -> None:
    assert judge("Stage01", GOOD).ok


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("alive", 9),
        ("outside", 1),
        ("farthest_outside_m", 0.6),
        ("through_walls", 1),
        ("walked", 7),
    ],
)
def test_each_fault_fails(name: str, value: float) -> None:
    assert not judge("Stage01", replace(GOOD, **{name: value})).ok


def surface_of(sidewalk_m: str) -> WalkableSurface:
    """A straight road along x: lanes of 3.5 m, then sidewalks whose lanes are so wide (m)."""
    lanes = "".join(
        f'<lane id="{number}" type="{kind}" level="false"><link/>'
        f'<width sOffset="0" a="{width}" b="0" c="0" d="0"/></lane>'
        for number, kind, width in ((-1, "driving", "3.5"), (-2, "sidewalk", sidewalk_m))
    )
    text = (
        '<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="4"/>'
        '<road name="" length="100" id="1" junction="-1"><link/><planView>'
        '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>'
        '<elevationProfile/><lateralProfile/><lanes><laneSection s="0"><center>'
        f'<lane id="0" type="none" level="false"/></center><right>{lanes}</right></laneSection>'
        "</lanes></road></OpenDRIVE>"
    )
    return WalkableSurface(carla.Map("one_road", text))


def test_wide_sidewalks_are_walkable_in_their_whole_width() -> None:
    places = np.array([(50.0, 4.0, 0.0), (50.0, 42.0, 0.0), (50.0, 45.5, 0.0)])
    assert surface_of("40").off_m(places).tolist() == pytest.approx([0.0, 0.0, 2.0], abs=0.01)


def test_on_a_map_without_crosswalks_the_sidewalks_alone_count() -> None:
    places = np.array([(50.0, 4.0, 0.0), (50.0, 1.0, 0.0), (np.nan, np.nan, np.nan)])
    expected = [0.0, 2.5, np.nan]
    assert surface_of("3").off_m(places).tolist() == pytest.approx(expected, abs=0.01, nan_ok=True)
