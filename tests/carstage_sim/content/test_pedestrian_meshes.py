"""Pedestrians stay in their capsule's box in every phase of the walk."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.content.pedestrians import PHASES, dress_of, pedestrian_mesh
from carstage_sim.labels import CityObjectLabel
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.state import ActorKind

WALKERS = [b for b in catalogue().values() if b.kind == ActorKind.WALKER]


@pytest.mark.parametrize("phase", range(PHASES + 1))
@pytest.mark.parametrize("extent", sorted({b.box_extent for b in WALKERS}))
def test_pedestrian_keeps_its_box_and_budget(extent, phase):
    for name in ("walker.pedestrian.0001", "walker.pedestrian.0007", "walker.pedestrian.0033"):
        mesh = pedestrian_mesh(name, extent, phase)
        low, high = mesh.bounds
        assert np.all(low >= -np.array(extent) - 0.02)
        assert np.all(high <= np.array(extent) + 0.02)
        assert high[2] - low[2] > 1.9 * extent[2]
        assert low[2] < -extent[2] + 0.05
        assert len(mesh.triangles) <= 1500
        assert set(mesh.tag.tolist()) == {CityObjectLabel.PEDESTRIANS}


def test_phases_of_a_walk_differ():
    meshes = [pedestrian_mesh("walker.pedestrian.0001", (0.19, 0.19, 0.93), k) for k in (0, 1, 3)]
    assert not np.array_equal(meshes[0].vertices, meshes[1].vertices)
    assert not np.array_equal(meshes[1].vertices, meshes[2].vertices)


def test_pedestrians_of_one_dress_are_one_figure():
    by_dress = {}
    for blueprint in WALKERS:
        by_dress.setdefault(dress_of(blueprint.id), []).append(blueprint.id)
    names = max(by_dress.values(), key=len)
    first, second = (pedestrian_mesh(n, (0.19, 0.19, 0.93)) for n in names[:2])
    assert np.array_equal(first.vertices, second.vertices)
    assert len(by_dress) > 3


def test_a_phase_out_of_range_is_refused():
    with pytest.raises(ValueError, match="phase"):
        pedestrian_mesh("walker.pedestrian.0001", (0.19, 0.19, 0.93), PHASES + 1)
