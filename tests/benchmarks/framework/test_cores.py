"""What more cores bring a tick is judged for 16 against 2 alone."""

from __future__ import annotations

import pytest

from benchmarks.framework.cores import Ticks, judge, measure_cores
from carstage.errors import BadInputError


def test_16_cores_have_to_be_six_times_as_fast_as_2() -> None:
    slow, fast = Ticks(0.3, 0.5), Ticks(0.06, 0.5)
    verdict = judge({2: [slow, slow, Ticks(9.0, 9.0)], 16: [fast, fast, fast]})
    figure = {one.name: one for one in verdict.figures}["faster_by_16_cores_than_by_2"]
    assert (float(figure.value), figure.target, figure.ok) == (pytest.approx(5.0), 6.0, False)
    assert judge({2: [slow], 16: [Ticks(0.04, 0.5)]}).ok


def test_other_numbers_are_only_told() -> None:
    assert judge({1: [Ticks(0.3, 0.3)], 2: [Ticks(0.3, 0.3)]}).ok
    assert judge({2: [Ticks(0.3, 0.3)]}).ok


def test_cores_that_are_not_there_are_refused() -> None:
    with pytest.raises(BadInputError, match="between 1 and"):
        measure_cores([100_000])
