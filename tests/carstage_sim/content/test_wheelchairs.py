"""Wheelchairs keep within their box, their wheels roll, and hands that push do not slide."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.content.people import dress_of
from carstage_sim.content.wheelchairs import (
    EXTENT,
    ROLL_PHASES,
    roll_m,
    seated_dress,
    seated_joints,
    wheelchair_mesh,
    wheelchair_meshes,
)
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material
from carstage_sim.world.blueprints import catalogue

ONE = "walker.pedestrian.0001"
USERS = [
    b.id
    for b in catalogue().values()
    if b.id.startswith("walker.") and b.attribute("can_use_wheelchair").value == "true"
]
PHASES = range(ROLL_PHASES + 1)


def material_of(mesh, material):
    return mesh.vertices[np.unique(mesh.triangles[mesh.material == material])]


@pytest.mark.parametrize("name", USERS)
def test_chair_and_body_keep_within_their_box_and_fill_it(name):
    for mesh in wheelchair_meshes(name, range(1, ROLL_PHASES + 1, 6)):
        low, high = mesh.bounds
        half = np.array(EXTENT)
        assert (low >= -half - 1e-3).all()
        assert (high <= half + 1e-3).all()
        assert (high - low >= 0.96 * 2.0 * half).all()
        assert set(mesh.tag.tolist()) == {CityObjectLabel.PEDESTRIANS}
        assert len(mesh.triangles) < 4200
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=2), 1.0, atol=1e-5)


def test_the_large_wheels_touch_the_ground_and_turn_with_the_way():
    meshes = wheelchair_meshes(ONE, PHASES)
    tyres = [material_of(mesh, Material.RUBBER) for mesh in meshes]
    for tyre in tyres:
        assert tyre[:, 2].min() == pytest.approx(-EXTENT[2], abs=2e-3)
    rims = np.array([material_of(mesh, Material.RIM) for mesh in meshes])
    middle = rims[1:].mean(axis=(0, 1))  # over a whole turn: the axle
    angles = np.unwrap(np.arctan2(*(rims[1:] - middle)[:, 0, [2, 0]].T))
    step = 2.0 * np.pi / ROLL_PHASES
    # Forward: what is above goes ahead, and a phase is a share of one turn.
    np.testing.assert_allclose(np.diff(angles), -step, atol=1e-4)
    tyre = tyres[1][tyres[1][:, 2] < 0.0]  # eyes are of the same material
    assert roll_m() == pytest.approx(np.pi * (tyre[:, 2].max() + EXTENT[2]), rel=0.01)


def test_hands_that_push_keep_to_the_rims_and_come_back_outside_of_them():
    step = 2.0 * np.pi / ROLL_PHASES
    hands = np.array([seated_joints(phase).hand[1] for phase in PHASES[1:]])
    rims = [material_of(mesh, Material.RIM) for mesh in wheelchair_meshes(ONE, PHASES[1:])]
    away = hands - np.array(rims).mean(axis=(0, 1))
    angle = np.unwrap(np.arctan2(away[:, 2], away[:, 0]))
    pushing = np.abs(np.diff(angle) + step) < 1e-3
    # Two pushes in a turn, each of nearly a radian.
    assert pushing.sum() * step > 1.5
    distance = np.hypot(away[:, 0], away[:, 2])
    held = np.concatenate([pushing, [False]])
    assert np.ptp(distance[held]) < 1e-5
    assert distance[~held].max() > distance[held].max() + 0.03
    assert (np.abs(away[:, 1] - away[0, 1]) < 1e-9).all()


def test_arms_and_legs_keep_their_length():
    poses = [seated_joints(phase) for phase in PHASES]
    for one, two, length in (
        ("shoulder", "elbow", 0.287), ("elbow", "hand", 0.261), ("hip", "knee", 0.44),
        ("knee", "ankle", 0.44),
    ):  # fmt: skip
        for side in (0, 1):
            bones = [getattr(p, two)[side] - getattr(p, one)[side] for p in poses]
            np.testing.assert_allclose(np.linalg.norm(bones, axis=1), length, atol=2e-3)


def test_the_same_triangles_follow_each_other_in_every_phase():
    meshes = wheelchair_meshes(ONE, PHASES)
    for mesh in meshes:
        assert np.array_equal(mesh.triangles, meshes[0].triangles)
        assert np.array_equal(mesh.material, meshes[0].material)
    assert np.array_equal(meshes[0].vertices, meshes[1].vertices)
    alone = wheelchair_mesh(ONE, seated_joints(7), 7)
    assert np.array_equal(alone.vertices, meshes[7].vertices)
    assert np.array_equal(alone.normals, meshes[7].normals)
    # From the last phase to the first is one more step, not a turn back.
    steps = [
        np.abs(a.vertices - b.vertices).max()
        for a, b in zip(meshes[1:], [*meshes[2:], meshes[1]], strict=True)
    ]
    assert max(steps) < 0.08


def test_who_sits_carries_nothing_in_hands_and_keeps_build_and_hair():
    for name in USERS:
        seated, standing = seated_dress(name), dress_of(name)
        assert (seated.bag, seated.held) == ("none", "nothing")
        assert "skirt" not in seated.bottom
        assert (seated.hair, seated.width, seated.female) == (
            standing.hair, standing.width, standing.female,
        )  # fmt: skip


def test_a_phase_out_of_range_is_refused():
    for phase in (-1, ROLL_PHASES + 1):
        with pytest.raises(ValueError, match="phase"):
            seated_joints(phase)
