"""Meshes on disk: the same as made ones, made again when they are damaged, never wrong."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from carstage_sim.content.people import has_umbrella
from carstage_sim.content.posing import Pose as Joints
from carstage_sim.content.walking import WALK_PHASES
from carstage_sim.content.wheelchairs import EXTENT, seated_joints
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh
from carstage_sim.sensors import actors
from carstage_sim.sensors.mesh_store import MeshStore
from carstage_sim.world.state import Weather
from sensor_worlds import box, state


class Maker:
    """Makes a box per key and counts."""

    def __init__(self) -> None:
        self.made: list[str] = []

    def __call__(self, key: str) -> TriangleMesh:
        self.made.append(key)
        return box((0, 0, 0), (len(key), 1, 1), Material.METAL, 14)


def same(one: TriangleMesh, other: TriangleMesh) -> bool:
    return all(np.array_equal(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))


def test_a_stored_mesh_equals_the_made_one_and_is_not_made_again(tmp_path):
    maker = Maker()
    first = MeshStore(maker, str, tmp_path)("car")
    assert same(first, MeshStore(maker, str, tmp_path)("car"))
    assert maker.made == ["car"]


def test_another_identity_has_another_mesh(tmp_path):
    maker = Maker()
    MeshStore(maker, lambda key: f"{key} long", tmp_path)("car")
    MeshStore(maker, lambda key: f"{key} short", tmp_path)("car")
    assert maker.made == ["car", "car"]


def test_what_has_no_identity_is_not_kept(tmp_path):
    MeshStore(Maker(), lambda _key: None, tmp_path)("pose")
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_file_is_made_again(tmp_path, caplog):
    maker = Maker()
    first = MeshStore(maker, str, tmp_path)("car")
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:100])
    assert same(first, MeshStore(maker, str, tmp_path)("car"))
    assert "unreadable" in caplog.text
    MeshStore(maker, str, tmp_path)("car")
    assert maker.made == ["car", "car"]


@pytest.mark.parametrize("folder", ["file", "file/below"])
def test_a_folder_that_cannot_be_written_costs_only_time(tmp_path, caplog, folder):
    (tmp_path / "file").write_text("in the way")
    store = MeshStore(Maker(), str, tmp_path / folder)
    assert len(store("car").triangles) == len(store("car").triangles)
    assert "not kept" in caplog.text


def test_open_doors_have_the_label_of_their_vehicle_also_when_it_changes(
    stage01, tmp_path, monkeypatch
):
    car = "vehicle.tesla.model3"
    blueprint = actors.catalogue()[car]
    for label in (CityObjectLabel.CAR, CityObjectLabel.BUS):
        changed = {car: replace(blueprint, semantic_tags=(int(label),))}
        monkeypatch.setattr(actors, "catalogue", lambda changed=changed: changed)
        mesh = actors.ActorModels(stage01, cache=tmp_path).mesh(f"{car}#1")
        assert label in mesh.tag


@pytest.mark.parametrize("one", ["walker.pedestrian.0004", "walker.pedestrian.0001"])
def test_umbrellas_are_open_while_it_rains(stage01, tmp_path, one):
    models = actors.ActorModels(stage01, cache=tmp_path)

    def model(precipitation: float, type_id: str = one) -> str:
        shown = state(walkers=[(7, (3.0, 0.0, 1.0), 0.0)], weather=Weather(0.0, precipitation))
        (placed,) = models.placements(replace(shown, type_id=(type_id,)))
        assert placed.actor_id == 7, "the umbrella is its pedestrian's in pictures of instances"
        return placed.model

    dry, drizzle, rain, dry_again = (model(percent) for percent in (0.0, 5.0, 60.0, 0.0))
    assert dry == drizzle == dry_again
    assert (rain != dry) == has_umbrella(one)
    meshes = [models.mesh(key) for key in (dry, rain)]
    assert (meshes[1].bounds[1, 2] > meshes[0].bounds[1, 2] + 0.04) == has_umbrella(one)
    assert models.keys_of(one)[0] == dry
    model(60.0)
    assert models.keys_of(one)[0] == rain, "what is spawned in rain is made with its umbrella"
    assert len(models.beside(rain)) == 1 + WALK_PHASES


def test_wheelchairs_roll_are_made_when_they_are_spawned_and_stay_under_posed_bones(
    stage01, tmp_path
):
    one = "walker.pedestrian.0001"
    models = actors.ActorModels(stage01, cache=tmp_path)

    def model(x: float, figures: dict[int, Joints] | None = None) -> str:
        shown = state(
            walkers=[(7, (x, 0.0, 1.0), 0.0), (8, (0.0, 9.0, 1.0), 0.0)],
            weather=Weather(0.0, 60.0),
        )
        changed = replace(shown, wheelchairs=frozenset({7}), figures=figures or {})
        sits, stands = models.placements(changed)
        assert stands.model in models.keys_of(one)
        return sits.model

    made = models.keys_of(one + actors.WHEELCHAIR)
    keys = [model(0.1 * step) for step in range(12)]
    assert set(keys) <= set(made)
    assert len(set(keys)) == 12
    posed = model(0.0, {7: seated_joints(3)})
    for key in (keys[0], posed):
        mesh = models.mesh(key)
        assert np.abs(mesh.bounds).max(axis=0) == pytest.approx(EXTENT, abs=0.03)
        assert Material.RIM in mesh.material


def test_all_who_are_posed_in_a_frame_have_their_mesh(stage01, tmp_path):
    models = actors.ActorModels(stage01, cache=tmp_path)
    crowd = range(1, 301)
    shown = state(walkers=[(one, (float(one), 0.0, 1.0), 0.0) for one in crowd])
    standing = seated_joints(0)
    figures = {one: replace(standing, head=standing.head + 1e-4 * one) for one in crowd}
    placed = models.placements(replace(shown, figures=figures))
    assert len({one.model for one in placed}) == 300
    for one in (placed[0], placed[-1]):
        assert len(models.mesh(one.model).triangles) > 100
