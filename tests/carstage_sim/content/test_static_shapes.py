"""Buildings, trees, shrubs and street furniture: sizes, names, materials, determinism."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.content.buildings import BUILDING_KINDS, building_mesh
from carstage_sim.content.shrubs import bush_mesh, far_tree_mesh, hedge_mesh
from carstage_sim.content.solids import box, placed, tube
from carstage_sim.content.street_furniture import (
    bench_mesh,
    bin_mesh,
    bus_shelter_mesh,
    hydrant_mesh,
    speed_sign_mesh,
    street_lamp_mesh,
    traffic_light_mesh,
)
from carstage_sim.content.trees import PRUNED_M, TREE_KINDS, tree_mesh
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.greenery import STREET_TREES
from carstage_sim.mesh import LEAF_CELLS, Material

LENSES = (Material.LIGHT_RED, Material.LIGHT_YELLOW, Material.LIGHT_GREEN)


def rng() -> np.random.Generator:
    return np.random.default_rng(3)


@pytest.mark.parametrize("kind", BUILDING_KINDS, ids=lambda kind: kind.name)
def test_a_building_fills_its_lot_and_has_windows_on_every_floor(kind):
    mesh = building_mesh(kind, 20.0, 12.0, kind.floors[1], rng())
    low, high = mesh.bounds
    assert low[0] == pytest.approx(-12.0, abs=0.6)
    assert (low[1], high[1]) == pytest.approx((-10.0, 10.0), abs=0.6)
    assert low[2] == pytest.approx(0.0, abs=1e-6)
    style = kind.style
    top = style.ground_floor_m + (kind.floors[1] - 1) * style.floor_m
    assert top < high[2] < top + 6.0
    assert set(mesh.tag) == {CityObjectLabel.BUILDINGS}
    panes = mesh.vertices[mesh.triangles[mesh.material == Material.FACADE_WINDOW]]
    heights = panes[..., 2].mean(axis=1)
    for floor in range(kind.floors[1] - 1):
        base = style.ground_floor_m + floor * style.floor_m
        assert ((heights > base) & (heights < base + style.floor_m)).sum() >= 8


@pytest.mark.parametrize("kind", BUILDING_KINDS, ids=lambda kind: kind.name)
def test_walls_have_no_holes(kind):
    """Rays at the front and the sides always meet something of the building."""
    mesh = building_mesh(kind, 16.0, 12.0, kind.floors[0], rng())
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    style = kind.style
    top = style.ground_floor_m + (kind.floors[0] - 1) * style.floor_m
    places = rng().uniform((0.05, 0.02), (0.95, 0.98), (120, 2))
    for axis, (begin, span) in ((1, (-8.0, 16.0)), (0, (-12.0, 12.0))):
        plane = corners[..., [axis, 2]]
        a, b, c = plane[:, 0], plane[:, 1], plane[:, 2]
        for u, v in places:
            p = np.array([begin + u * span, v * top])
            sides = [
                (q[:, 0] - o[:, 0]) * (p[1] - o[:, 1]) - (q[:, 1] - o[:, 1]) * (p[0] - o[:, 0])
                for o, q in ((a, b), (b, c), (c, a))
            ]
            inside = np.all(np.array(sides) >= 0, axis=0) | np.all(np.array(sides) <= 0, axis=0)
            depth = corners[inside, :, 1 - axis].mean(axis=1)
            # Something near either outer wall, so no ray enters the house.
            limits = (-12.0, 0.0) if axis == 1 else (-8.0, 8.0)
            assert depth.min() < limits[0] + 0.7
            assert depth.max() > limits[1] - 0.7


@pytest.mark.parametrize("kind", TREE_KINDS, ids=lambda kind: kind.name)
def test_a_tree_has_its_height_and_a_clear_trunk(kind):
    mesh = tree_mesh(kind, 9.0, rng())
    low, high = mesh.bounds
    assert low[2] == pytest.approx(0.0, abs=1e-6)
    assert high[2] == pytest.approx(9.0, abs=1.3)
    assert set(mesh.tag) == {CityObjectLabel.VEGETATION}
    leafy = np.isin(mesh.material, list(LEAF_CELLS))
    assert set(mesh.material[~leafy]) <= {Material.BARK, Material.BARK_PALE}
    leaves = mesh.vertices[mesh.triangles[leafy]]
    assert leaves[..., 2].min() > 0.6
    assert len(mesh.triangles) < 700
    assert np.abs(np.linalg.norm(mesh.normals, axis=2) - 1.0).max() < 1e-3


@pytest.mark.parametrize("kind", STREET_TREES, ids=lambda kind: kind.name)
def test_a_tree_beside_a_road_is_pruned_above_vehicles_and_still_has_a_crown(kind):
    for height in kind.height_m:
        mesh = tree_mesh(kind, height, rng())
        leafy = np.isin(mesh.material, list(LEAF_CELLS))
        assert mesh.vertices[mesh.triangles[leafy]][..., 2].min() >= PRUNED_M - 1e-5
        assert leafy.sum() > 0.7 * kind.sprays


def test_autumn_changes_nothing_but_what_the_leaves_are():
    summer, autumn = (tree_mesh(TREE_KINDS[0], 9.0, rng(), autumn=turned) for turned in (0, 1))
    assert np.array_equal(summer.vertices, autumn.vertices)
    changed = summer.material != autumn.material
    assert np.array_equal(changed, np.isin(summer.material, list(LEAF_CELLS)))


def test_shrubs_and_far_trees_stand_on_the_ground_and_are_light():
    for mesh, most in (
        (bush_mesh(0.8, rng()), 150),
        (hedge_mesh(3.0, 1.0, 0.7, rng()), 500),
        (far_tree_mesh(9.0, rng()), 60),
        (far_tree_mesh(9.0, rng(), pointed=True), 60),
    ):
        assert set(mesh.tag) == {CityObjectLabel.VEGETATION}
        assert mesh.bounds[0][2] == pytest.approx(0.0, abs=0.21)
        assert len(mesh.triangles) < most
        assert np.abs(np.linalg.norm(mesh.normals, axis=2) - 1.0).max() < 1e-3


def test_equal_seeds_give_equal_shapes():
    first, second = (tree_mesh(TREE_KINDS[0], 8.0, rng()) for _ in range(2))
    assert np.array_equal(first.vertices, second.vertices)
    kind = BUILDING_KINDS[0]
    houses = [building_mesh(kind, 16.0, 12.0, 4, rng()) for _ in range(2)]
    assert np.array_equal(houses[0].material, houses[1].material)


@pytest.mark.parametrize("head", [(4.9, 0.0, 5.4, -90.0), (3.15, 0.0, 5.4, -90.0)])
def test_a_traffic_lights_lenses_look_along_the_heads_yaw(head):
    mesh = traffic_light_mesh(head)
    yaw = np.radians(head[3])
    facing = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    middles = []
    for lens in LENSES:
        rows = mesh.material == lens
        assert rows.sum() >= 8
        assert set(mesh.tag[rows]) == {CityObjectLabel.TRAFFIC_LIGHT}
        assert mesh.normals[rows].reshape(-1, 3) == pytest.approx(
            np.broadcast_to(facing, (rows.sum() * 3, 3)), abs=1e-5
        )
        places = mesh.vertices[mesh.triangles[rows]].reshape(-1, 3)
        over_road = places[np.abs(places[:, 0] - head[0]) < 0.5]
        middles.append((over_road.min(axis=0) + over_road.max(axis=0)) / 2)
    assert middles[0][2] > middles[1][2] > middles[2][2]
    assert middles[1] == pytest.approx(np.array(head[:3]) + 0.115 * facing, abs=0.02)
    # The foot reaches below a kerb beside it.
    assert mesh.bounds[0][2] == pytest.approx(-0.2, abs=1e-6)
    assert set(mesh.tag) == {CityObjectLabel.POLES, CityObjectLabel.TRAFFIC_LIGHT}


def test_a_traffic_light_from_behind_is_three_round_housings_before_its_plate():
    mesh = traffic_light_mesh((4.9, 0.0, 5.4, 0.0))
    corners = mesh.vertices[mesh.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    head = (mesh.tag == CityObjectLabel.TRAFFIC_LIGHT) & (corners[..., 0].min(axis=1) > 4.5)
    # The back of the plate, and of the housings that stand out behind it.
    plate = head & (np.ptp(corners[..., 2], axis=1) > 1.2) & (normal[:, 0] < -0.99)
    round_ = (
        head & (normal[:, 0] < -0.1) & (corners[..., 0].max(axis=1) < corners[plate, :, 0].min())
    )
    assert corners[plate, :, 0].min() - corners[round_, :, 0].min() > 0.12
    assert len(set(np.round(normal[round_, 1], 2))) >= 6
    gaps = np.diff(np.unique(np.round(corners[round_, :, 2], 3)))
    assert np.sum(gaps < 0.05) == 2


def test_a_speed_sign_shows_its_figures_to_the_front():
    thirty, fifty = speed_sign_mesh(30), speed_sign_mesh(50)
    for mesh in (thirty, fifty):
        figures = mesh.vertices[mesh.triangles[mesh.material == Material.PLASTIC_DARK]]
        plate = mesh.vertices[mesh.triangles[mesh.material == Material.SIGN_WHITE]]
        assert figures[..., 0].min() > plate[..., 0].max()
        assert np.abs(figures[..., 1]).max() < 0.25
    lit = [set(map(tuple, m.vertices[m.triangles].mean(axis=1).round(3))) for m in (thirty, fifty)]
    assert lit[0] != lit[1]


@pytest.mark.parametrize(
    "make", [bench_mesh, bin_mesh, hydrant_mesh, bus_shelter_mesh, street_lamp_mesh]
)
def test_furniture_stands_on_the_ground(make):
    mesh = make()
    assert mesh.bounds[0][2] == pytest.approx(0.0, abs=0.1)
    assert len(mesh.triangles) < 200


def test_a_box_turns_about_the_vertical_axis():
    mesh = box((1.0, 2.0, 3.0), (2.0, 1.0, 0.5), Material.WOOD, CityObjectLabel.STATIC, yaw_deg=90)
    assert mesh.bounds == pytest.approx(np.array([[0.0, 0.0, 2.5], [2.0, 4.0, 3.5]]), abs=1e-5)
    outward = np.einsum(
        "ti,ti->t",
        mesh.normals[:, 0],
        mesh.vertices[mesh.triangles].mean(axis=1) - np.array([1.0, 2.0, 3.0]),
    )
    assert (np.abs(outward) > 0.4).all()


def test_placing_moves_turns_and_numbers():
    post = tube([(0, 0, 0), (0, 0, 2)], 0.1, Material.METAL, CityObjectLabel.POLES)
    arm = box((1.0, 0.0, 1.0), (0.5, 0.1, 0.1), Material.METAL, CityObjectLabel.POLES)
    moved = placed(arm, (10.0, 5.0, 0.0), yaw_deg=90.0, object_id=7)
    assert moved.bounds == pytest.approx(np.array([[9.9, 5.5, 0.9], [10.1, 6.5, 1.1]]), abs=1e-5)
    assert set(moved.object_id) == {7}
    assert set(placed(post, (0, 0, 0)).object_id) == {0}
