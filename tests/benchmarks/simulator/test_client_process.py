"""Trials in their own process: results come back, failures are distinguished."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from benchmarks.simulator.client_process import TrialError, run_trial


def home_and_sum(left: int, *, right: int) -> tuple[str, int]:
    return str(Path.home()), left + right


def fail() -> None:
    raise ValueError("no such street")


def die() -> None:
    os._exit(3)


def test_result_comes_from_a_process_with_its_own_home() -> None:
    home, total = run_trial(home_and_sum, 2, right=3, timeout_s=60.0)
    assert total == 5
    assert home != str(Path.home())
    assert not Path(home).exists()


def test_an_exception_comes_back_with_its_traceback() -> None:
    with pytest.raises(TrialError, match="no such street"):
        run_trial(fail, timeout_s=60.0)


def test_a_dead_process_is_told_by_its_exit_status() -> None:
    with pytest.raises(TrialError, match="exit status 3"):
        run_trial(die, timeout_s=60.0)
