"""The scene store: stored hierarchies, look-up tables of a frame, the carrier around a sensor."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.mesh import Material, build_mesh
from carstage_sim.render.scene import (
    PAINTS,
    PASSING,
    Placement,
    SceneStore,
    cached_tree,
    linear_colour,
)
from ray_scenes import frame_of, shoot, sphere, turned_box

pytestmark = pytest.mark.xdist_group("kernels")


def test_a_stored_hierarchy_equals_the_built_one(tmp_path):
    mesh = sphere(2)
    built = cached_tree(mesh, tmp_path)
    (path,) = tmp_path.iterdir()
    stamp = path.stat().st_mtime_ns
    stored = cached_tree(mesh, tmp_path)
    assert path.stat().st_mtime_ns == stamp
    for name in type(built).__dataclass_fields__:
        assert np.array_equal(getattr(built, name), getattr(stored, name))


def test_a_damaged_hierarchy_is_built_again(tmp_path, caplog):
    mesh = sphere(2)
    built = cached_tree(mesh, tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:100])
    again = cached_tree(mesh, tmp_path)
    assert np.array_equal(built.children, again.children)
    assert "unreadable" in caplog.text
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert np.array_equal(cached_tree(mesh, tmp_path).order, built.order)


def test_another_mesh_has_another_file(tmp_path):
    cached_tree(sphere(1), tmp_path)
    cached_tree(sphere(2), tmp_path)
    assert len(list(tmp_path.iterdir())) == 2


def test_a_folder_that_cannot_be_written_costs_only_time(tmp_path, caplog):
    (tmp_path / "file").write_text("in the way")
    tree = cached_tree(sphere(1), tmp_path / "file" / "trees")
    assert len(tree.order) == len(sphere(1).triangles)
    assert "not kept" in caplog.text


def test_a_mesh_is_asked_for_once_per_model():
    asked = []

    def mesh_of(key):
        asked.append(key)
        return turned_box((1.0, 1.0, 1.0))

    store = SceneStore(None, mesh_of, cache=None)
    place = Placement(1, "a", np.zeros(3), np.eye(3))
    store.frame([place, place])
    store.frame([place, Placement(2, "b", np.zeros(3), np.eye(3))])
    assert asked == ["a", "b"]


def test_a_model_that_was_prepared_costs_its_first_frame_nothing():
    asked = []

    def mesh_of(key):
        asked.append(key)
        return turned_box((1.0, 1.0, 1.0))

    store = SceneStore(None, mesh_of, cache=None)
    place = Placement(1, "a", np.zeros(3), np.eye(3))
    unprepared = store.frame([place])
    store.prepare(["b", "a", "b"])
    assert asked == ["a", "b"]
    frame = store.frame([place, Placement(2, "b", np.ones(3), np.eye(3))])
    assert asked == ["a", "b"]
    assert len(frame.actors.tag) == 2 * len(unprepared.actors.tag)


def test_colours_are_those_of_who_is_in_each_frame():
    store = SceneStore(None, lambda _key: turned_box((1.0, 1.0, 1.0)), cache=None)
    red, blue = (((200, 0, 0),) * PAINTS, ((0, 0, 200),) * PAINTS)

    def frame(*colours):
        return store.frame(
            [Placement(n, "a", np.zeros(3), np.eye(3), one) for n, one in enumerate(colours)]
        )

    first = frame(red, blue)
    for colours in ((red, blue), (blue, red), (blue,), (), (red, blue)):
        wanted = linear_colour(np.array(colours, np.uint8).reshape(-1, PAINTS, 3))
        assert np.array_equal(frame(*colours).colour, wanted)
    assert np.array_equal(first.colour, frame(red, blue).colour), "it stays as it was"


def test_models_of_one_moment_leave_no_hierarchy_in_the_cache(tmp_path):
    store = SceneStore(None, lambda _key: turned_box((1.0, 1.0, 1.0)), cache=tmp_path)
    store.prepare([f"figure{PASSING}pose"])
    assert list(tmp_path.iterdir()) == []
    store.prepare(["figure"])
    assert len(list(tmp_path.iterdir())) == 1


def test_frames_stay_as_they_are_while_models_come_and_go():
    meshes = {"stays": sphere(3), "late": turned_box((1.0, 4.0, 1.0))}
    meshes |= {f"ball{PASSING}{k}": sphere(k % 3) for k in range(40)}
    store = SceneStore(None, meshes.__getitem__, cache=None)
    across = np.linspace(-1.5, 1.5, 31)
    rays = np.stack([np.ones((31, 31)), *np.meshgrid(across, across)], axis=2)

    def seen(frame):
        hits = shoot(frame, np.array([-4.0, 0.1, 0.2]), rays)
        first = np.array([shape.first for shape in frame.shapes])
        return hits.t, hits.row, np.where(hits.row >= 0, hits.triangle - first[hits.row], -1)

    made, most = [], 0
    for k in range(40):
        models = ["stays", f"ball{PASSING}{k}", *["late"] * (k > 20)]
        places = [
            Placement(n + 1, model, np.array([3.0 * n, 1.0 - n, 0.0]), np.eye(3))
            for n, model in enumerate(models)
        ]
        alone = seen(frame_of(None, places, meshes))
        assert set(alone[1].tolist()) == {-2, *range(len(models))}
        frame = store.frame(places)
        made.append((frame, alone))
        kept = sum(len(shape.corners) for shape in frame.shapes)
        most = max(most, len(frame.actors.tag) / kept)
    for frame, alone in made:
        for one, other in zip(seen(frame), alone, strict=True):
            assert np.array_equal(one, other)
    assert 1.5 < most < 4.0, "what was given up goes, but not at once"


def test_a_point_inside_the_carriers_box_names_its_row():
    place = Placement(9, "box", np.array([10.0, 5.0, 0.0]), np.eye(3))
    frame = frame_of(None, [place], {"box": turned_box((4.0, 2.0, 2.0))})
    assert frame.row_around(9, np.array([11.0, 5.5, 0.5])) == 0
    assert frame.row_around(9, np.array([11.0, 5.5, 1.1])) == -1
    assert frame.row_around(8, np.array([11.0, 5.5, 0.5])) == -1


def test_a_read_only_mesh_can_be_stored():
    mesh = sphere(1)
    for name in ("vertices", "triangles", "normals", "material", "tag", "object_id"):
        getattr(mesh, name).setflags(write=False)
    frame = frame_of(mesh)
    assert all(array.flags.writeable for array in frame.static)


def test_colours_become_linear_light():
    linear = linear_colour(np.array([[0, 128, 255]], np.uint8))
    assert linear[0].tolist() == pytest.approx([0.0, 0.2158605, 1.0])
    place = Placement(1, "a", np.zeros(3), np.eye(3), colours=((0, 128, 255),) * PAINTS)
    frame = frame_of(None, [place], {"a": sphere(1)})
    assert frame.colour.shape == (1, PAINTS, 3)
    assert np.array_equal(frame.colour[0, 4], linear[0])


def test_window_rectangles_are_known_by_their_pairs():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1.0]])
    mesh = build_mesh(corners, [[0, 1, 2], [0, 2, 3], [0, 1, 3]], Material.FACADE_WINDOW, 3)
    size = 4 * 10 + 512 * 10  # decimetres
    assert frame_of(mesh).static.pane.tolist() == [size + 1, size + 2, 0]
