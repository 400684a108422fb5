"""The campaign of chaos in short: eight episodes, two workers, a store that fails."""

from __future__ import annotations

import pytest

from benchmarks.framework.chaos import measure_chaos


@pytest.mark.end_to_end
@pytest.mark.xdist_group("runs")
def test_eight_episodes_are_there_once_whatever_breaks() -> None:
    verdict = measure_chaos(episodes=8, workers=2, seed=8, every_s=8.0)
    assert verdict.ok, verdict.text()
