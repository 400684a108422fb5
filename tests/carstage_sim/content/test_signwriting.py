"""Letters of shop signs: shapes out of strokes, as high and wide as asked."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.content.facades import _SHOPS
from carstage_sim.content.signwriting import written


def corners(text, **how):
    """``(quads, 4, 2)`` places along and up."""
    return np.array(written(text, 1.4, **how))


def area(quads):
    """Area of each quad, positive counterclockwise."""
    x, y = quads[..., 0], quads[..., 1]
    return 0.5 * (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)


@pytest.mark.parametrize("name", [*_SHOPS, "ABCDEFGHIJKLM", "NOPQRSTUVWXYZ", "0123456789"])
def test_each_sign_is_as_high_as_asked_and_in_the_middle(name):
    quads = corners(name)
    low, high = quads.min(axis=(0, 1)), quads.max(axis=(0, 1))
    assert (low[1], high[1]) == pytest.approx((-0.7, 0.7), abs=1e-9)
    assert low[0] + high[0] == pytest.approx(0.0, abs=0.16)
    assert (area(quads) > -1e-9).all()


def test_an_o_is_round_and_its_stroke_keeps_its_width():
    quads = corners("O", weight=2.0)
    outer, inner = quads[:, 0], quads[:, 3]
    assert len({tuple(np.round(p, 6)) for p in outer}) >= 12
    width = np.linalg.norm(outer - inner, axis=1)
    assert width == pytest.approx(np.full(len(quads), 0.2), abs=0.01)
    # Closed: each quad begins where the one before ended.
    np.testing.assert_allclose(np.roll(quads[:, 1], 1, axis=0), outer, atol=1e-9)


def test_strokes_of_a_bold_sign_cover_more_and_letters_of_a_wide_one_reach_farther():
    thin, bold = (corners("BAKERY", weight=weight) for weight in (1.5, 2.5))
    assert area(bold).sum() > 1.5 * area(thin).sum()
    narrow, wide = (corners("BAKERY", wide=factor) for factor in (0.8, 1.2))
    assert np.ptp(wide[..., 0]) == pytest.approx(1.5 * np.ptp(narrow[..., 0]), rel=1e-6)


def test_no_two_letters_look_alike():
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
    shapes = {written(letter, 1.4)[0] + tuple(written(letter, 1.4)) for letter in letters}
    assert len(shapes) == len(letters)
