"""Noise and drop-off of flash LiDARs are judged both ways: too little, and too much."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.framework.flash_lidar import _NOISE_M, _figures, _Found


def failed(*, noise: float, kept: int) -> set[str]:
    """What fails of a perfect measurement but for its noise (of what was asked) and points."""
    draws = np.random.default_rng(0).normal(size=200_000)
    draws = (draws - draws.mean()) / draws.std()
    right, same = [np.zeros(2000)], [np.ones(2000, np.bool_)]
    found = _Found(
        right, right, right, right, [draws * noise * _NOISE_M], right, right, same, same,
        kept=kept, possible=10_000, echoes=1, wide_beams=1, cast_echoes=1,
    )  # fmt: skip
    return {figure.name for figure in _figures(found) if not figure.ok}


def test_what_was_asked_is_good() -> None:
    assert failed(noise=1.0, kept=9000) == set()


@pytest.mark.parametrize("noise", [0.9, 1.5])
def test_other_noise_is_found(noise: float) -> None:
    assert len(failed(noise=noise, kept=9000)) == 1


@pytest.mark.parametrize("kept", [8000, 10_000])
def test_other_drop_off_is_found(kept: int) -> None:
    assert len(failed(noise=1.0, kept=kept)) == 1
