"""Baking and caching: the same town every time, and what is in it."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
import shapely

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps import (
    MapSamplingError,
    UnknownTownError,
    available_towns,
    load_town,
    spawn_point_count,
)
from carstage_sim.maps.baking import bake, sample_in_child
from carstage_sim.maps.cache import cached_town, digest_of, load, save
from carstage_sim.maps.surfaces import KERB_HEIGHT_M
from carstage_sim.maps.writer import PLANS, opendrive_of


def test_a_fresh_bake_equals_the_cached_town(stage01):
    opendrive = opendrive_of(PLANS["Stage01"])
    assert bake("Stage01", opendrive).digest == stage01.digest


def test_a_saved_town_is_read_back_whole(stage01, tmp_path):
    save(stage01, tmp_path / "town.npz")
    again = load(tmp_path / "town.npz")
    assert again.digest == stage01.digest == digest_of(again)
    assert again.traffic_lights == stage01.traffic_lights
    assert again.level_objects == stage01.level_objects
    assert [path.name for path in tmp_path.iterdir()] == ["town.npz"]


def test_a_cache_hit_does_not_bake(stage01, tmp_path):
    bakes = []

    def make():
        bakes.append(1)
        return stage01

    for _ in range(2):
        assert cached_town("T", "<a/>", make, tmp_path / "towns").digest == stage01.digest
    assert len(bakes) == 1
    cached_town("T", "<b/>", make, tmp_path / "towns")
    assert len(bakes) == 2


@pytest.mark.parametrize("name", available_towns())
def test_the_number_of_spawn_points_is_known_without_a_bake(name):
    assert spawn_point_count(name) == len(load_town(name).spawn_points)


def test_a_damaged_cache_file_is_replaced(stage01, tmp_path):
    cached_town("T", "<a/>", lambda: stage01, tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:1000])
    assert cached_town("T", "<a/>", lambda: stage01, tmp_path).digest == stage01.digest
    assert load(path).digest == stage01.digest


def test_an_unknown_town_is_refused_with_the_nearest_name(tmp_path):
    with pytest.raises(UnknownTownError, match="did you mean 'Stage01'") as caught:
        load_town("Stage1", cache_folder=tmp_path)
    assert caught.value.nearest == "Stage01"
    assert available_towns() == tuple(PLANS)


def test_a_file_that_is_no_map_is_reported_with_the_childs_words():
    with pytest.raises(MapSamplingError, match="map Broken"):
        sample_in_child("this is not xml", "Broken")


def test_loading_maps_does_not_import_the_client():
    code = "import sys, carstage_sim.maps; sys.exit('carla' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_static_triangles_stay_within_the_budget(stage01):
    mesh = stage01.static_mesh
    assert 150_000 < len(mesh.triangles) < 420_000
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    sizes = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert np.isfinite(mesh.vertices).all()
    assert (sizes > 1e-9).all()
    assert np.abs(np.linalg.norm(mesh.normals, axis=2) - 1.0).max() < 1e-3


def test_level_objects_box_their_own_triangles(stage01):
    mesh = stage01.static_mesh
    order = np.argsort(mesh.object_id, kind="stable")
    ids = mesh.object_id[order]
    for number, entry in enumerate(stage01.level_objects, start=1):
        assert entry.object_id == number
        if number % 9:
            continue
        rows = order[np.searchsorted(ids, number) : np.searchsorted(ids, number, "right")]
        assert len(rows) > 0
        yaw = np.radians(entry.box.rotation_deg[1])
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        local = mesh.vertices[mesh.triangles[rows]].reshape(-1, 3) - np.array(entry.box.center)
        local[:, :2] = local[:, :2] @ turn
        reach = np.abs(local).max(axis=0)
        assert reach == pytest.approx(np.array(entry.box.extent), abs=2e-3)
    assert mesh.object_id.max() == len(stage01.level_objects)


def test_scenery_is_labelled(stage01):
    mesh = stage01.static_mesh
    labels = Counter(CityObjectLabel(entry.label) for entry in stage01.level_objects)
    assert labels[CityObjectLabel.BUILDINGS] > 80
    assert labels[CityObjectLabel.VEGETATION] > 100
    assert labels[CityObjectLabel.POLES] > 50
    assert labels[CityObjectLabel.TRAFFIC_SIGNS] > 10
    own = {
        CityObjectLabel.BUILDINGS: {CityObjectLabel.BUILDINGS},
        CityObjectLabel.VEGETATION: {CityObjectLabel.VEGETATION},
        CityObjectLabel.POLES: {CityObjectLabel.POLES},
        CityObjectLabel.TRAFFIC_SIGNS: {CityObjectLabel.TRAFFIC_SIGNS, CityObjectLabel.POLES},
        CityObjectLabel.STATIC: {CityObjectLabel.STATIC},
    }
    kinds = np.array([0, *(entry.label for entry in stage01.level_objects)])
    for label, tags in own.items():
        rows = kinds[mesh.object_id] == label
        assert set(np.unique(mesh.tag[rows])) <= {int(tag) for tag in tags}


def test_nothing_stands_on_the_road(stage01):
    """Footprints of everything but tree crowns and lamp arms keep off the driving lanes."""
    lanes = stage01.lanes.location[::3, :2]
    for entry in stage01.level_objects:
        if entry.label == CityObjectLabel.BUILDINGS:
            yaw = np.radians(entry.box.rotation_deg[1])
            turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
            local = (lanes - np.array(entry.box.center[:2])) @ turn
            assert (np.abs(local) > np.array(entry.box.extent[:2]) + 1.5).any(axis=1).all()


def test_furniture_reaches_into_the_ground_and_into_nothing_else(stage01):
    """A little into the ground, which may slope."""
    mesh, found = stage01.static_mesh, []
    for entry in stage01.level_objects:
        if entry.label != CityObjectLabel.STATIC:
            continue
        corners = mesh.vertices[mesh.triangles[mesh.object_id == entry.object_id]].reshape(-1, 3)
        assert -0.12 < corners[:, 2].min() - KERB_HEIGHT_M <= 0.0, entry.name
        found.append(shapely.MultiPoint(corners[:, :2]).convex_hull)
    kinds = {entry.name.rpartition("_")[0] for entry in stage01.level_objects}
    assert kinds >= {"Bench", "Bin", "Hydrant", "BikeParking", "Mailbox", "PlantPot", "TrashCan"}
    houses = [
        shapely.MultiPoint(mesh.vertices[mesh.triangles[low]].reshape(-1, 3)[:, :2]).convex_hull
        for low in _below(stage01, CityObjectLabel.BUILDINGS)
    ]
    tree = shapely.STRtree([*found, *houses])
    for number, thing in enumerate(found):
        near = tree.query(thing.buffer(-0.05), predicate="intersects")
        assert near.tolist() == [number]


def _below(town, label, height_m=1.5):
    """Rows of the triangles near the ground of each object of a label."""
    mesh = town.static_mesh
    low = mesh.vertices[mesh.triangles][..., 2].max(axis=1) < height_m
    numbers = [entry.object_id for entry in town.level_objects if entry.label == label]
    rows = [np.flatnonzero(low & (mesh.object_id == number)) for number in numbers]
    return [row for row in rows if len(row)]


def test_two_bakes_of_an_altered_plan_differ(stage01):
    other = dataclasses.replace(PLANS["Stage01"], kerb_radius_m=9.0)
    text = opendrive_of(other)
    assert bake(other.name, text).digest != stage01.digest
