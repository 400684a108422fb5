"""Reference lines: each kind of geometry against its definition, integrated by brute force."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from carstage.vector_map.course import Course, Cubics, Piece, fine_stations

EMPTY = Cubics.of([])


def walked(curvature: object, length_m: float) -> tuple[float, float, float]:
    """Where a walk ends that turns by a function of the way, in a million straight steps."""
    steps = 1_000_000
    way = (np.arange(steps) + 0.5) * (length_m / steps)
    step = length_m / steps
    turn = np.cumsum(curvature(way)) * step  # type: ignore[operator]
    heading = turn - curvature(way) * step / 2  # type: ignore[operator]
    return float(np.cos(heading).sum() * step), float(np.sin(heading).sum() * step), float(turn[-1])


@pytest.mark.parametrize(
    ("begin", "end", "length_m"), [(0.0, 0.05, 40), (0.02, -0.04, 80), (-0.1, 0.0, 30), (0, 1, 60)]
)
def test_a_spiral_turns_evenly_more(begin: float, end: float, length_m: float) -> None:
    piece = Piece(0, 0, 0, 0, length_m, "spiral", (begin, end))
    found = [float(value[0]) for value in piece.at(np.array([length_m]))]
    expected = walked(lambda s: begin + (end - begin) * s / length_m, length_m)
    assert found == pytest.approx(expected, abs=1e-6)


def test_an_arc_is_a_circle_and_a_line_is_one_without_curvature() -> None:
    arc = Piece(0, 5, -2, math.pi / 2, 100, "arc", (0.1,))
    x, y, heading = (float(value[0]) for value in arc.at(np.array([5 * math.pi])))
    assert (x, y, heading) == pytest.approx((-5, 8, math.pi))  # a quarter about (-5, -2)
    line = Piece(0, 5, -2, math.pi / 2, 100, "line")
    assert [float(v[0]) for v in line.at(np.array([7.0]))] == pytest.approx([5, 5, math.pi / 2])


@pytest.mark.parametrize("unit", [1.0, 30.0])
def test_a_parametric_cubic_is_walked_by_its_length(unit: float) -> None:
    """u = 30 q, v = 8 q² with the parameter q of 0 to 1, or of 0 to 30."""
    factors = (0, 30 / unit, 0, 0, 0, 0, 8 / unit**2, 0, unit)
    q = np.linspace(0, 1, 400_001)
    ways = np.concatenate([[0], np.cumsum(np.hypot(np.diff(30 * q), np.diff(8 * q**2)))])
    piece = Piece(0, 0, 0, 0, float(ways[-1]), "paramPoly3", factors)
    s = np.linspace(0, ways[-1], 50)
    x, y, heading = piece.at(s)
    there = np.interp(s, ways, q)
    assert x == pytest.approx(30 * there, abs=1e-4)
    assert y == pytest.approx(8 * there**2, abs=1e-4)
    assert heading == pytest.approx(np.arctan2(16 * there, 30), abs=1e-5)


def test_a_cubic_beside_a_line_is_walked_by_its_length_and_turned() -> None:
    u = np.linspace(0, 30, 400_001)
    v = 1 + 0.02 * u**2 - 0.0004 * u**3
    ways = np.concatenate([[0], np.cumsum(np.hypot(np.diff(u), np.diff(v)))])
    piece = Piece(0, 10, 20, math.pi / 2, float(ways[-1]), "poly3", (1, 0, 0.02, -0.0004))
    x, y, _ = piece.at(np.array([0.0, ways[-1]]))
    assert x == pytest.approx([10 - 1, 10 - v[-1]], abs=1e-3)
    assert y == pytest.approx([20, 50], abs=1e-3)


def test_polynomials_hold_from_their_station_to_the_next_one() -> None:
    cubics = Cubics.of([(10, 5, 1, 0, 0), (0, 1, 0, 0.5, 0), (20, -1, 0, 0, 2)])
    assert cubics.at(np.array([0.0, 4, 10, 15, 21])) == pytest.approx([1, 9, 5, 10, 1])
    assert EMPTY.at(np.array([3.0])) == pytest.approx([0])


def test_chords_stay_within_the_tolerance_of_all_curves() -> None:
    pieces = (
        Piece(0, 0, 0, 0, 50, "line"),
        Piece(50, 50, 0, 0, 30, "arc", (0.15,)),
        Piece(80, 0, 0, 0, 40, "spiral", (0.0, -0.2)),
    )
    course = Course(pieces, Cubics.of([(0, 0, 0, 0.01, 0)]), EMPTY)
    sides = np.array([[-12.0], [0.0], [3.0]])

    def places(s: np.ndarray) -> np.ndarray:
        return course.beside(s, np.broadcast_to(sides, (3, len(s))))

    found = fine_stations(places, np.array([0.0, 50, 80, 120]), 0.01, 10_000)
    assert len(found) < 500
    for begin, end in itertools.pairwise(found):
        a, b = places(np.array([begin]))[:, 0], places(np.array([end - 1e-9]))[:, 0]
        middle = places(np.array([(begin + end) / 2]))[:, 0]
        along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
        off = (middle - a) - ((middle - a) * along).sum(axis=1, keepdims=True) * along
        assert np.linalg.norm(off, axis=1).max() < 0.01
