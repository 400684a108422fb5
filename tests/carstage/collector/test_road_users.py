"""Distances between boxes on the ground, and how fast they shrink."""

from __future__ import annotations

import math

import pytest

from carstage.collector.scenario.storyboard.road_users import Body, closing_m_s, distance_m


def body(x: float, y: float, yaw_deg: float = 0.0, speed_m_s: float = 0.0) -> Body:
    yaw = math.radians(yaw_deg)
    velocity = (speed_m_s * math.cos(yaw), speed_m_s * math.sin(yaw))
    return Body((x, y), yaw, velocity, (x, y), (2.0, 1.0))


@pytest.mark.parametrize(
    ("other", "measure", "freespace", "expected_m"),
    [
        (body(10, 0), "euclidean", False, 10.0),
        (body(10, 0), "euclidean", True, 6.0),
        (body(10, 0, 90), "euclidean", True, 7.0),
        (body(3, 4), "euclidean", False, 5.0),
        (body(7, 6), "euclidean", True, 5.0),  # from corner to corner: 3 ahead, 4 aside
        (body(3, 1), "euclidean", True, 0.0),
        (body(0, 0, 45), "euclidean", True, 0.0),
        (body(10, 3), "longitudinal", False, 10.0),
        (body(-10, 3), "longitudinal", True, 6.0),
        (body(1, 3), "longitudinal", True, 0.0),
        (body(10, -3), "lateral", False, 3.0),
        (body(10, -3), "lateral", True, 1.0),
    ],
)
def test_distances(other: Body, measure: str, freespace: bool, expected_m: float) -> None:
    assert distance_m(body(0, 0), other, measure, freespace) == pytest.approx(expected_m)


def test_a_body_is_measured_along_its_own_heading() -> None:
    assert distance_m(body(0, 0, 90), body(3, 8), "longitudinal", False) == pytest.approx(8.0)
    assert distance_m(body(0, 0, 90), body(3, 8), "lateral", False) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("one", "other", "measure", "expected_m_s"),
    [
        (body(0, 0, 0, 10), body(50, 0, 0, 4), "euclidean", 6.0),
        (body(0, 0, 0, 10), body(50, 0, 180, 4), "longitudinal", 14.0),
        (body(50, 0, 0, 10), body(0, 0, 0, 4), "euclidean", -6.0),
        (body(50, 0, 0, 10), body(0, 0, 0, 4), "longitudinal", -6.0),
        (body(0, 0), body(5, 8, -90, 3), "lateral", 3.0),
    ],
)
def test_who_comes_nearer(one: Body, other: Body, measure: str, expected_m_s: float) -> None:
    assert closing_m_s(one, other, measure) == pytest.approx(expected_m_s, abs=1e-9)
