"""The walkers check fails on what it is there to notice."""

from __future__ import annotations

from dataclasses import replace

import pytest

from carstage_sim.check.walkers import WalkerFigures, judge

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
