"""The figures of the check ``render`` mean what they claim."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.simulator.render.flatness import share_of_flat
from benchmarks.simulator.render.grounding import GroundProbe
from benchmarks.simulator.render.looks import lab, shadow_error_deg
from benchmarks.simulator.render.scene import named_presets, town_of
from benchmarks.simulator.render.standing import (
    Things,
    gaps_and_depths,
    overlaps,
    plants_in_walls,
    thing_figures,
    vehicle_figures,
)
from carstage_sim.content.solids import box, placed
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes

pytestmark = pytest.mark.xdist_group("kernels")


def test_colours_are_those_of_the_standard():
    codes = np.array([[255, 255, 255], [0, 0, 0], [255, 0, 0]], np.uint8)
    expected = [[100.0, 0.0, 0.0], [0.0, 0.0, 0.0], [53.2, 80.1, 67.2]]
    assert lab(codes) == pytest.approx(np.array(expected), abs=0.2)


def test_patches_without_structure_count_where_no_sky_is_in_them():
    grey = np.indices((64, 96)).sum(axis=0) * 1.0
    grey[:32, :32], grey[32:, 32:64] = 20.0, 12.0
    grey[32:, 64:] = 12.0 + np.indices((32, 32)).sum(axis=0) % 2 * 2.5
    seen = np.ones(grey.shape, np.bool_)
    assert share_of_flat(grey, seen) == pytest.approx(2 / 6)
    seen[5, 5] = False
    assert share_of_flat(grey, seen) == pytest.approx(1024 / (64 * 96 - 1))


def test_the_clients_presets_are_found_with_their_values():
    presets = named_presets()
    assert len(presets) == 22
    assert presets["HardRainNoon"].precipitation == 100.0
    assert presets["ClearNight"].sun_altitude_angle == -90.0


def test_gaps_below_points_are_measured_and_foundations_have_none():
    corners = np.array([[-50.0, -50, 0], [50, -50, 10], [50, 50, 10], [-50, 50, 0]])
    slope = build_mesh(
        corners, np.array([[0, 1, 2], [0, 2, 3]]), Material.GRASS, CityObjectLabel.TERRAIN
    )
    gaps = GroundProbe(slope)(np.array([[0.0, 0.0, 5.2], [10.0, 0.0, 6.0], [0.0, 0.0, 2.0]]))
    assert gaps == pytest.approx([0.2, 0.0, -3.0], abs=1e-3)


def test_what_is_high_above_ground_below_a_bridge_is_not_buried():
    road, deck = _ground(0.0), _ground(9.0)
    gaps = GroundProbe(merge_meshes([road, deck]))(np.array([[0.0, 0.0, 1.5]]))
    assert gaps == pytest.approx([1.5], abs=1e-3)


def test_a_support_in_the_air_and_one_in_the_ground_are_found():
    metal, tag = Material.METAL, CityObjectLabel.STATIC
    level = [box((x, 0.0, 0.5), (0.05, 0.05, 0.5), metal, tag) for x in (-2.0, 2.0)]
    high = [box((2.0, 0.0, 0.55), (0.05, 0.05, 0.5), metal, tag)]
    parts = [level, [level[0], *high], [level[0], placed(level[1], (0.0, 0.0, -0.07))]]
    meshes = [_numbered(merge_meshes(part), k + 1, (0.0, 4.0 * k)) for k, part in enumerate(parts)]
    things = Things(
        merge_meshes([_ground(0.0), *meshes]), ["ground", "a", "b", "c"], np.zeros(4, np.bool_)
    )
    gap, inside = gaps_and_depths(things)
    assert gap == pytest.approx([0.0, 0.05, 0.0], abs=1e-3)
    assert inside == pytest.approx([0.0, 0.05, 0.07], abs=1e-3)
    assert overlaps(things) == []


def test_things_in_each_other_and_twigs_in_walls_are_found():
    static, green = CityObjectLabel.STATIC, CityObjectLabel.VEGETATION
    house = box((0.0, 0.0, 4.0), (3.0, 3.0, 4.0), Material.BRICK, CityObjectLabel.BUILDINGS)
    leaf = box((3.0, 0.0, 5.0), (0.2, 0.2, 0.2), Material.LEAVES, green)
    near = box((3.16, 2.0, 0.5), (0.2, 0.2, 0.5), Material.METAL, static)
    far = box((3.24, -2.0, 0.5), (0.2, 0.2, 0.5), Material.METAL, static)
    meshes = [_numbered(mesh, k + 1, (0.0, 0.0)) for k, mesh in enumerate((house, leaf, near, far))]
    kinds = ["ground", "Building", "Tree", "Bin", "Bench"]
    things = Things(merge_meshes([_ground(0.0), *meshes]), kinds, np.zeros(5, np.bool_))
    assert overlaps(things) == []
    assert plants_in_walls(things) == 1
    closer = _numbered(placed(near, (-0.06, 0.0, 0.0)), 3, (0.0, 0.0))
    meshes[2] = closer
    things = Things(merge_meshes([_ground(0.0), *meshes]), kinds, np.zeros(5, np.bool_))
    assert overlaps(things) == [("Building", "Bin")]


def _ground(height_m: float) -> TriangleMesh:
    corners = np.array([[x, y, height_m] for x, y in ((-50, -50), (50, -50), (50, 50), (-50, 50))])
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    return build_mesh(corners.astype(float), quad, Material.ASPHALT, CityObjectLabel.ROADS)


def _numbered(mesh: TriangleMesh, number: int, at: tuple[float, float]) -> TriangleMesh:
    return placed(mesh, (*at, 0.0), object_id=number)


@pytest.mark.parametrize("town", ["Stage01", "Stage02", "Stage03", "Town10HD"])
def test_all_things_of_a_town_stand_on_its_ground_and_in_nothing_else(town):
    figures = list(thing_figures(town_of(town)))
    assert figures[0].value > 500
    assert [figure for figure in figures if not figure.ok] == []


@pytest.mark.parametrize("town", ["Stage01", "Stage02"])
def test_vehicles_at_all_spawn_points_stand_on_the_road(town):
    wheels = ["vehicle.nissan.micra", "vehicle.mitsubishi.fusorosa", "vehicle.bh.crossbike"]
    figures = list(vehicle_figures(town_of(town), wheels))
    assert [figure for figure in figures if not figure.ok] == []


def test_the_shadow_of_a_pole_points_away_from_the_sun():
    assert shadow_error_deg() <= 2.0
