"""Meshes on disk: the same as made ones, made again when they are damaged, never wrong."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh
from carstage_sim.sensors import actors
from carstage_sim.sensors.mesh_store import MeshStore
from sensor_worlds import box


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
