"""Tar, repairs and covers lie on the roads, outside junctions, and keep off crosswalks."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.baking import sample_in_child
from carstage_sim.maps.levels import station_levels
from carstage_sim.maps.road_wear import UNWORN, road_wear
from carstage_sim.maps.strips import crosswalks, strips
from carstage_sim.mesh import Material

WORN = (
    Material.COVER, Material.ASPHALT_NEW, Material.TAR,
)  # fmt: skip


@pytest.fixture(scope="module")
def lanes_and_walks(stage01):
    samples = sample_in_child(stage01.opendrive, "Stage01")
    return strips(samples, station_levels(samples)), [one.area for one in crosswalks(samples)]


def wear_of(lanes_and_walks, seed=3):
    return road_wear(*lanes_and_walks, np.random.default_rng(seed))


def parts(wear):
    return [wear.covers, wear.repairs, wear.tar]


def test_all_kinds_of_wear_lie_on_lanes_that_are_driven_or_beside_them(lanes_and_walks):
    lanes, _ = lanes_and_walks
    driven = [lane.polygon for lane in lanes if lane.kind in ("driving", "shoulder")]
    paved = shapely.union_all(driven).buffer(0.3)
    for part in parts(wear_of(lanes_and_walks)):
        assert part.area > 1.0
        assert part.difference(paved).area < 0.01 * part.area


def test_crosswalks_are_kept_free(lanes_and_walks):
    walks = shapely.union_all(lanes_and_walks[1])
    assert walks.area > 10.0
    for part in parts(wear_of(lanes_and_walks)):
        assert part.intersection(walks).area < 1e-6


def test_the_same_seed_gives_the_same_wear_and_another_one_other(lanes_and_walks):
    first, again, other = (wear_of(lanes_and_walks, seed) for seed in (3, 3, 4))
    assert all(a.equals_exact(b, 0.0) for a, b in zip(parts(first), parts(again), strict=True))
    assert not first.tar.equals(other.tar)


def test_no_lane_no_wear():
    found = road_wear([], [], np.random.default_rng(1))
    assert all(part.is_empty for part in [*parts(found), *parts(UNWORN)])


def test_worn_road_is_road(stage01):
    mesh = stage01.static_mesh
    for material in WORN:
        here = (mesh.material == material) & (mesh.object_id == 0)
        assert here.any(), material.name
        assert set(mesh.tag[here]) == {CityObjectLabel.ROADS}


def test_no_grass_grows_between_a_house_and_its_sidewalk(stage01):
    mesh = stage01.static_mesh
    middle = mesh.vertices[mesh.triangles].mean(axis=1)
    walks = middle[mesh.material == Material.SIDEWALK][:, :2]
    grass = shapely.union_all(
        shapely.polygons(mesh.vertices[mesh.triangles[mesh.material == Material.GRASS]][..., :2])
    )
    tree = shapely.STRtree(shapely.points(walks))
    houses = [one for one in stage01.level_objects if one.label == CityObjectLabel.BUILDINGS]
    checked = 0
    for house in houses:
        x, y, _ = house.box.center
        c, s = (f(np.radians(house.box.rotation_deg[1])) for f in (np.cos, np.sin))
        ahead = house.box.extent[0] + 0.1
        front = shapely.Point(x + c * ahead, y + s * ahead)
        if len(tree.query(front, predicate="dwithin", distance=3.0)):
            checked += 1
            assert not grass.contains(front)
    assert checked > 20
