"""The hills beyond the land."""

from __future__ import annotations

import numpy as np
import shapely

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.horizon import hills_mesh


def test_hills_close_the_view_on_all_sides_and_begin_below_the_land():
    land = shapely.box(-300.0, -200.0, 500.0, 200.0)
    mesh = hills_mesh(land, lambda places: np.full(len(places), 2.0), np.random.default_rng(1))
    assert set(mesh.tag) == {CityObjectLabel.VEGETATION}
    inside = shapely.contains_xy(land, mesh.vertices[:, 0], mesh.vertices[:, 1])
    assert inside.any()
    assert mesh.vertices[inside, 2].max() < 2.0
    outer = mesh.vertices[~inside & (mesh.vertices[:, 2] > 4.0)].astype(np.float64)
    bearing = np.sort(np.arctan2(outer[:, 1], outer[:, 0] - 100.0))
    assert np.diff(bearing).max() < np.radians(6.0)
