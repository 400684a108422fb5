"""Short forms of the acceptance checks, with the real client and a real server each."""

from __future__ import annotations

import pytest

from benchmarks.simulator.determinism import check_determinism
from benchmarks.simulator.traffic import check_traffic
from benchmarks.simulator.walkers import check_walkers

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("embedded_server")]


def test_twenty_vehicles_flow_for_twenty_seconds() -> None:
    campaign = check_traffic(vehicles=20, walkers=5, seconds=20.0, seed=11, lone_seconds=2.0)
    verdict = campaign.verdicts["Stage01"]
    figures = {figure.name: figure for figure in verdict.figures}
    # So short a drive begins at rest and may end at a red light.
    del figures["mean_speed_percent_of_free_flow"]
    assert all(figure.ok for figure in figures.values()), verdict.text()
    assert figures["stop_lines_passed"].value > 0


def test_a_second_try_gives_the_same_frames() -> None:
    verdict = check_determinism(ticks=100, vehicles=20, walkers=5, seed=11)
    assert verdict.ok, verdict.text()


def test_pedestrians_keep_to_where_they_may_walk() -> None:
    verdict = check_walkers(walkers=8, seconds=20.0, seed=11).verdicts["Stage01"]
    assert verdict.ok, verdict.text()
