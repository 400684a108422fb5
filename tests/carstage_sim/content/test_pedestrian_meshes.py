"""Pedestrians have human sizes, and one order of triangles in every pose."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.content.pedestrians import (
    PHASES,
    dress_of,
    pedestrian_mesh,
    walking_joints,
)
from carstage_sim.labels import CityObjectLabel
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.state import ActorKind

WALKERS = [b for b in catalogue().values() if b.kind == ActorKind.WALKER]
ADULT = (0.19, 0.19, 0.93)


def walking(name, extent, phase):
    return pedestrian_mesh(name, extent, walking_joints(extent, phase))


@pytest.mark.parametrize("phase", range(PHASES + 1))
@pytest.mark.parametrize("extent", sorted({b.box_extent for b in WALKERS}))
def test_pedestrian_is_as_tall_as_its_box_and_as_wide_as_a_human(extent, phase):
    for name in ("walker.pedestrian.0001", "walker.pedestrian.0007", "walker.pedestrian.0033"):
        mesh = walking(name, extent, phase)
        low, high = mesh.bounds
        tall = 2.0 * extent[2]
        assert -extent[2] - 0.02 <= low[2] < -extent[2] + 0.05
        assert 0.95 * tall < high[2] - low[2] <= tall + 0.02
        # Shoulder breadth over arms: a quarter to a third of the height.
        assert 0.25 * tall < high[1] - low[1] < 0.34 * tall
        assert high[0] - low[0] < 0.5 * tall
        assert len(mesh.triangles) <= 1500
        assert set(mesh.tag.tolist()) == {CityObjectLabel.PEDESTRIANS}


def test_steps_and_arms_leave_the_capsule():
    low, high = walking("walker.pedestrian.0001", ADULT, 3).bounds
    assert low[0] < -0.28
    assert high[0] > 0.30
    assert high[1] > 0.25


@pytest.mark.parametrize("name", sorted({b.id for b in WALKERS})[::7])
def test_the_same_triangles_follow_each_other_in_every_pose(name):
    standing = walking(name, ADULT, 0)
    for phase in range(1, PHASES + 1):
        mesh = walking(name, ADULT, phase)
        assert np.array_equal(mesh.triangles, standing.triangles)
        assert np.array_equal(mesh.material, standing.material)
        moved = np.linalg.norm(mesh.vertices - standing.vertices, axis=1)
        assert 0.05 < moved.max() < 0.4


def test_phases_of_a_walk_differ():
    meshes = [walking("walker.pedestrian.0001", ADULT, k) for k in (0, 1, 3)]
    assert not np.array_equal(meshes[0].vertices, meshes[1].vertices)
    assert not np.array_equal(meshes[1].vertices, meshes[2].vertices)


def test_pedestrians_of_one_dress_are_one_figure():
    by_dress = {}
    for blueprint in WALKERS:
        by_dress.setdefault(dress_of(blueprint.id), []).append(blueprint.id)
    names = max(by_dress.values(), key=len)
    first, second = (walking(n, ADULT, 0) for n in names[:2])
    assert np.array_equal(first.vertices, second.vertices)
    assert len(by_dress) > 3


def test_a_phase_out_of_range_is_refused():
    with pytest.raises(ValueError, match="phase"):
        walking_joints(ADULT, PHASES + 1)
