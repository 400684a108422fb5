"""Every static prop lies in its box and is tagged as one."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.content.props import prop_mesh
from carstage_sim.labels import CityObjectLabel
from carstage_sim.world.blueprints import catalogue

PROPS = [b for b in catalogue().values() if b.id.startswith("static.prop.")]


@pytest.mark.parametrize("blueprint", PROPS, ids=lambda b: b.id)
def test_prop_keeps_its_box_and_tag(blueprint):
    mesh = prop_mesh(blueprint.id, blueprint.box_extent)
    low, high = mesh.bounds
    center, extent = np.array(blueprint.box_center), np.array(blueprint.box_extent)
    assert np.all(low >= center - extent - 0.01)
    assert np.all(high <= center + extent + 0.01)
    assert high[2] > 0.9 * (center[2] + extent[2])
    assert set(mesh.tag.tolist()) == {CityObjectLabel.STATIC}
