"""Every static prop lies in its box and is tagged as one."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.content.props import prop_mesh
from carstage_sim.labels import CityObjectLabel
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.blueprints.props import has_shape

PROPS = [b for b in catalogue().values() if has_shape(b.id)]


def test_props_of_carlas_catalogue_are_there_and_look_like_themselves():
    assert len(PROPS) > 95
    crate = prop_mesh("static.prop.box01", (0.4, 0.4, 0.4))
    seen = {}
    for name in ("busstop", "plantpot01", "swing", "streetsign01", "shoppingcart", "fountain"):
        mesh = prop_mesh(f"static.prop.{name}", (0.4, 0.4, 0.4))
        seen[name] = mesh.vertices.tobytes()
    assert len({crate.vertices.tobytes(), *seen.values()}) == 7


@pytest.mark.parametrize("blueprint", PROPS, ids=lambda b: b.id)
def test_prop_keeps_its_box_and_tag(blueprint):
    mesh = prop_mesh(blueprint.id, blueprint.box_extent)
    low, high = mesh.bounds
    center, extent = np.array(blueprint.box_center), np.array(blueprint.box_extent)
    assert np.all(low >= center - extent - 0.01)
    assert np.all(high <= center + extent + 0.01)
    assert high[2] > 0.9 * (center[2] + extent[2])
    assert set(mesh.tag.tolist()) == {CityObjectLabel.STATIC}
