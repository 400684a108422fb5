"""Waiting for what other threads and processes bring about."""

from __future__ import annotations

import time
from collections.abc import Callable

_LOOKS_EVERY_S = 0.01


def await_that(holds: Callable[[], bool], within_s: float = 30.0) -> None:
    """Return as soon as a condition holds, and fail when it does not in time."""
    deadline = time.monotonic() + within_s
    while not holds():
        assert time.monotonic() < deadline, f"not within {within_s:g} s"
        time.sleep(_LOOKS_EVERY_S)


def holds_for(seconds: float, holds: Callable[[], bool]) -> bool:
    """Whether a condition holds all the time."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if not holds():
            return False
        time.sleep(_LOOKS_EVERY_S)
    return True
