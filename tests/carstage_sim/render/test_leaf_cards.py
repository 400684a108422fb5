"""Cards of leaves: rays go between the leaves, and every ray meets the same ones."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import LEAF_CELLS, Material, build_mesh
from ray_scenes import frame_of, shoot

pytestmark = pytest.mark.xdist_group("kernels")

CARD = np.array([(0.0, -1.0, -1.0), (0.0, 1.0, -1.0), (0.0, -1.0, 1.0)])


def seen(material, origin, *, side=160):
    """Which rays to places of a card meet it; the places, as shares of its sides."""
    s, t = np.meshgrid(*[(np.arange(side) + 0.5) / side] * 2)
    on_it = s + t < 0.98
    places = CARD[0] + s[on_it, None] * (CARD[1] - CARD[0]) + t[on_it, None] * (CARD[2] - CARD[0])
    card = build_mesh(CARD, np.array([[0, 1, 2]]), material, CityObjectLabel.VEGETATION)
    hits = shoot(frame_of(card), np.asarray(origin, float), places - origin)
    return hits.triangle >= 0, np.stack([s[on_it], t[on_it]], axis=1)


@pytest.mark.parametrize("material", sorted(LEAF_CELLS))
def test_a_card_has_leaves_and_gaps(material):
    met, _ = seen(material, (-3.0, 0.0, 0.0))
    assert 0.25 < met.mean() < 0.8
    whole, _ = seen(Material.FOLIAGE, (-3.0, 0.0, 0.0))
    assert whole.all()


def test_the_leaves_are_the_same_from_everywhere():
    first, _ = seen(Material.LEAVES, (-3.0, 0.0, 0.0))
    for origin in ((-9.0, 4.0, 3.0), (5.0, -0.5, 0.2)):
        other, _ = seen(Material.LEAVES, origin)
        assert (first == other).mean() > 0.995


def test_no_leaf_is_cut_by_the_third_side():
    """That is the side from the first corner to the second."""
    met, places = seen(Material.LEAVES, (-3.0, 0.0, 0.0))
    assert not met[places[:, 1] < 0.02].any()
    assert met[places[:, 1] > 0.2].any()
