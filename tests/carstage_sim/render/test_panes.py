"""Panes of buildings: rooms behind the glass have depth, differ, and are even from afar."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.kernels import kernel
from carstage_sim.render.detail import DOOR, SHOP, WINDOW
from carstage_sim.render.panes import half_of, pane_colour, size_of

pytestmark = pytest.mark.xdist_group("kernels")

SIZE = {WINDOW: (1.4, 1.8), SHOP: (4.4, 2.6), DOOR: (1.3, 2.6)}


@kernel
def _look(kind, size, number, pixel, night, view, out):
    rows, columns = out.shape[0], out.shape[1]
    for i in range(rows):
        for j in range(columns):
            s = (np.float32(j) + np.float32(0.5)) / np.float32(columns)
            t = (np.float32(i) + np.float32(0.5)) / np.float32(rows)
            found = pane_colour(
                kind, s, t, (size[0], size[1]), number, pixel, night, (view[0], view[1], view[2])
            )
            for k in range(7):
                out[i, j, k] = found[k]


@kernel
def _unpack(packed, out):
    out[0] = half_of(packed)
    out[1], out[2] = size_of(packed)


def seen(kind, number, *, view=(0.0, 0.0, 1.0), pixel=0.01, night=0.0, side=24):
    """``(side, side, 7)`` what a pane shows all over: see ``pane_colour``."""
    way = np.asarray(view, np.float32) / np.float32(np.linalg.norm(view))
    out = np.empty((side, side, 7), np.float32)
    size = np.array(SIZE[kind], np.float32)
    _look(kind, size, number, np.float32(pixel), np.float32(night), way, out)
    return out


@pytest.mark.parametrize("kind", [WINDOW, SHOP])
def test_what_is_behind_glass_moves_against_the_frame(kind):
    straight, aslant = (seen(kind, 40, view=(slope, 0.0, 1.0)) for slope in (0.0, 0.5))
    np.testing.assert_array_equal(straight[..., 0], aslant[..., 0])  # the frame
    glass = straight[..., 0] == 0.0
    assert glass.mean() > 0.4
    assert (np.abs(straight - aslant)[glass].max(axis=-1) > 0.01).mean() > 0.1


def test_a_door_is_opaque_and_looks_alike_from_everywhere():
    straight, aslant = (seen(DOOR, 8, view=(slope, 0.2, 1.0)) for slope in (0.0, 0.7))
    np.testing.assert_array_equal(straight, aslant)
    assert (straight[..., 0] == 1.0).all()
    assert (straight[..., 4:] == 0.0).all()


@pytest.mark.parametrize("kind", [WINDOW, SHOP, DOOR])
def test_neighbours_differ(kind):
    means = {seen(kind, number, side=12)[..., 1:4].mean().round(6) for number in range(0, 40, 2)}
    assert len(means) > 15


@pytest.mark.parametrize("kind", [WINDOW, SHOP])
def test_from_afar_a_pane_has_no_pattern_behind_its_bars(kind):
    far = seen(kind, 12, pixel=0.5)
    near = seen(kind, 12, pixel=0.01)
    assert far[..., 1:4].std(axis=(0, 1)).max() < 0.5 * near[..., 1:4].std(axis=(0, 1)).max()


def test_shops_are_lit_by_day_and_homes_by_night_only():
    assert seen(SHOP, 40)[..., 4:].max() > 0.05
    assert all(seen(WINDOW, n, side=4)[..., 4:].max() == 0.0 for n in range(30))
    lit = [seen(WINDOW, n, side=4, night=1.0)[..., 4:].max() > 0.0 for n in range(60)]
    assert 0.2 < np.mean(lit) < 0.55


@pytest.mark.parametrize("kind", [WINDOW, SHOP, DOOR])
@pytest.mark.parametrize("view", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.7, 0.7, 1e-6)])
def test_all_numbers_are_finite_at_any_slant(kind, view):
    for number in range(0, 30, 2):
        found = seen(kind, number, view=view, side=6, night=0.5)
        assert np.isfinite(found).all()
        assert found.min() >= 0.0


def test_a_pane_knows_its_half_and_size():
    out = np.empty(3, np.float32)
    _unpack(2 + 4 * 44 + 512 * 26, out)
    assert out.tolist() == pytest.approx([2.0, 4.4, 2.6])
