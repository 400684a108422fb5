"""Rectangles on the ground against a slow search: distances, overlaps, times to collision."""

from __future__ import annotations

import numpy as np
import pytest

from carstage.geometry.ground_rectangles import (
    Rectangles,
    distance_m,
    overlap,
    time_to_collision_s,
)


def rectangle(
    x: float, y: float, yaw_deg: float, length_m: float, width_m: float, vx: float, vy: float
) -> Rectangles:
    yaw = np.radians(yaw_deg)
    return Rectangles(
        np.array([[x, y]]),
        np.array([[np.cos(yaw), np.sin(yaw)]]),
        np.array([[length_m / 2, width_m / 2]]),
        np.array([[vx, vy]]),
    )


def test_a_car_ahead_is_as_far_as_its_bumper_and_met_at_the_difference_of_speeds() -> None:
    ego = rectangle(0, 0, 0, 4, 2, 10, 0)
    ahead = rectangle(14, 0.5, 0, 4, 2, 4, 0)
    assert distance_m(ego, ahead) == pytest.approx(10.0)
    assert time_to_collision_s(ego, ahead) == pytest.approx(10.0 / 6.0)
    assert not overlap(ego, ahead).any()


def test_who_drives_away_or_passes_beside_is_never_met() -> None:
    ego = rectangle(0, 0, 0, 4, 2, 10, 0)
    assert np.isinf(time_to_collision_s(ego, rectangle(14, 0, 0, 4, 2, 12, 0))).all()
    assert np.isinf(time_to_collision_s(ego, rectangle(14, 3, 180, 4, 2, -10, 0))).all()
    assert np.isinf(time_to_collision_s(ego, rectangle(14, 0, 0, 4, 2, 10, 0))).all()


def test_what_overlaps_is_at_no_distance_and_met_already() -> None:
    ego, other = rectangle(0, 0, 0, 4, 2, 0, 0), rectangle(2, 1, 45, 3, 1, 0, 0)
    assert overlap(ego, other).all()
    assert distance_m(ego, other) == 0.0
    assert time_to_collision_s(ego, other) == 0.0


@pytest.mark.parametrize("seed", range(12))
def test_any_two_agree_with_a_search_over_their_borders_and_over_time(seed: int) -> None:
    rng = np.random.default_rng(seed)
    numbers = [
        (*rng.uniform(-9, 9, 2), rng.uniform(0, 360), *rng.uniform(1, 6, 2), *rng.uniform(-4, 4, 2))
        for _ in range(2)
    ]
    one, other = (rectangle(*each) for each in numbers)
    if not overlap(one, other).any():
        apart = _border(one)[:, None] - _border(other)[None, :]
        nearest_m = float(np.hypot(apart[..., 0], apart[..., 1]).min())
        assert float(distance_m(one, other)[0]) == pytest.approx(nearest_m, abs=0.02)
    times = np.arange(0.0, 12.0, 0.005)
    touching = [t for t in times if overlap(_later(one, t), _later(other, t)).any()]
    found = float(time_to_collision_s(one, other)[0])
    if touching:
        assert found == pytest.approx(touching[0], abs=0.006)
    else:
        assert found > times[-1] - 0.01


def _later(one: Rectangles, seconds: float) -> Rectangles:
    return Rectangles(one.center + one.velocity * seconds, one.heading, one.half, one.velocity)


def _border(one: Rectangles) -> np.ndarray:
    corners = one.corners[0]
    share = np.linspace(0.0, 1.0, 400)[:, None]
    return np.concatenate(
        [a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )
