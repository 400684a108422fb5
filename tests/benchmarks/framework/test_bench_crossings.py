"""The benchmark of crossings: what its verdict calls bad."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.framework.crossings import Crossing, verdict_on

FINE = Crossing(
    walker=7, begin=10, end=60, on_crosswalk=True, light="Red", ttc_s=6.0, in_view=True, whole=True
)


def test_crossings_at_red_with_nobody_near_are_good() -> None:
    assert verdict_on("Stage01", [[FINE], [FINE, replace(FINE, light="")]]).ok


@pytest.mark.parametrize(
    ("episode", "figure"),
    [
        ([replace(FINE, in_view=False)], "least_in_view_of_the_ego"),
        ([], "least_in_view_of_the_ego"),
        ([FINE, replace(FINE, light="Green")], "against_the_light"),
        ([FINE, replace(FINE, light="Yellow")], "against_the_light"),
        ([FINE, replace(FINE, ttc_s=1.4)], "less_than_2_s_before_a_vehicle"),
    ],
)
def test_what_is_bad_is_named(episode: list[Crossing], figure: str) -> None:
    verdict = verdict_on("Stage01", [[FINE], episode])
    assert [one.name for one in verdict.figures if not one.ok] == [figure]
