"""Things are set down on sloping ground so that they neither float nor sink."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from carstage_sim.content.solids import box
from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.placement import SceneryPlacement
from carstage_sim.mesh import Material, merge_meshes

_CLIMB, _BANK = 0.06, -0.03


class Slope:
    """An even slope, towards x and y."""

    def height(self, points):
        return 5.0 + _CLIMB * points[:, 0] + _BANK * points[:, 1]


def set_down(label, mesh, place=(10.0, -4.0, 30.0), also=()):
    placement = SceneryPlacement()
    for other in also:
        placement.put(*other)
    placement.put("Thing", label, mesh, place)
    placement.set_down(Slope())
    return placement


def test_a_foot_reaches_down_to_the_slope_and_the_top_stays_level():
    post = box((0.0, 0.0, 1.0), (1.0, 0.5, 1.0), Material.METAL, CityObjectLabel.STATIC)
    (mesh,) = set_down(CityObjectLabel.STATIC, post).meshes
    above = mesh.vertices[:, 2] - Slope().height(mesh.vertices.astype(float))
    top = mesh.vertices[:, 2] > mesh.vertices[:, 2].max() - 0.5
    assert above[~top] == pytest.approx(0.0, abs=1e-4)
    assert np.ptp(mesh.vertices[top, 2]) < 1e-4
    assert above[top].min() == pytest.approx(2.0, abs=1e-4)


def test_a_parked_car_leans_as_the_road_under_its_wheels():
    wheels = [
        box((x, y, 0.3), (0.05, 0.05, 0.3), Material.RUBBER, CityObjectLabel.CAR)
        for x in (-1.2, 1.4)
        for y in (-0.8, 0.8)
    ]
    placement = set_down(CityObjectLabel.CAR, merge_meshes(wheels))
    (mesh,), (thing,) = placement.meshes, placement.objects
    above = mesh.vertices[:, 2] - Slope().height(mesh.vertices.astype(float))
    assert above.min() == pytest.approx(0.0, abs=2e-3)
    assert np.sum(np.abs(above) < 2e-3) >= 16
    turn = rotation_matrix(np.array(thing.box.rotation_deg))
    local = (mesh.vertices.astype(float) - np.array(thing.box.center)) @ turn
    assert np.abs(local).max(axis=0) == pytest.approx(np.array(thing.box.extent), abs=1e-3)


def test_plants_are_pruned_where_a_wall_stands():
    house = box((0.0, 0.0, 3.0), (4.0, 4.0, 3.0), Material.BRICK, CityObjectLabel.BUILDINGS)
    leaves = [
        box((x, 0.0, 2.0), (0.1, 0.1, 0.1), Material.LEAVES, CityObjectLabel.VEGETATION)
        for x in (-0.5, 0.5)
    ]
    trunk = box((0.0, 0.0, 1.0), (0.1, 0.1, 1.0), Material.BARK, CityObjectLabel.VEGETATION)
    building = ("House", CityObjectLabel.BUILDINGS, house, (10.0, -4.0, 0.0))
    tree = merge_meshes([trunk, *leaves])
    _, mesh = set_down(CityObjectLabel.VEGETATION, tree, (14.4, -4.0, 0.0), [building]).meshes
    assert len(mesh.triangles) == len(tree.triangles) - 12
    wall = shapely.box(6.0, -8.0, 14.0, 0.0)
    assert not shapely.contains_xy(wall, mesh.vertices[:, 0], mesh.vertices[:, 1]).any()


@pytest.mark.parametrize(
    ("x", "bridge_m", "stands"), [(10.0, 8.0, False), (10.0, 9.1, True), (15.5, 8.0, True)]
)
def test_nothing_is_put_where_it_would_reach_into_a_bridge(
    x: float, bridge_m: float, stands: bool
) -> None:
    class Deck:
        def height(self, points):
            return np.full(len(points), bridge_m)

    post = box((0.0, 0.0, 1.0), (1.0, 0.5, 1.0), Material.METAL, CityObjectLabel.POLES)
    placement = SceneryPlacement()
    placement.put("Post", CityObjectLabel.POLES, post, (x, -4.0, 0.0))  # 5.7 to 7.8 m high
    placement.set_down(Slope(), [(shapely.box(6.0, -8.0, 14.0, 0.0), Deck())])
    assert bool(placement.objects) is stands
