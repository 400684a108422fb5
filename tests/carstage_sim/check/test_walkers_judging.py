"""The walkers check fails on what it is there to notice."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import carla
import numpy as np
import pytest

from carstage_sim.check.walkers import WalkableSurface, WalkerFigures, judge

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


def test_on_a_map_without_crosswalks_the_sidewalks_alone_count() -> None:
    sidewalk = SimpleNamespace(transform=carla.Transform(carla.Location(0.0, 2.0, 0.0)))
    sidewalk.lane_width = 3.0
    town = SimpleNamespace(get_crosswalks=list, get_waypoint=lambda *_, **_options: sidewalk)
    surface = WalkableSurface(cast(Any, town))
    places = np.array([(0.0, 1.0, 0.0), (0.0, -4.0, 0.0), (np.nan, np.nan, np.nan)])
    assert surface.off_m(places).tolist() == pytest.approx([0.0, 4.5, np.nan], nan_ok=True)
