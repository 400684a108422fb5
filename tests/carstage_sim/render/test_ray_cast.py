"""The ray caster against an independent one, and the rules for ties, edges and instances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from carstage_sim.geometry import rotation_matrix
from carstage_sim.render.cast import NOTHING, STATIC
from carstage_sim.render.scene import Placement
from ray_scenes import frame_of, moller_trumbore, shoot, soup, sphere, turned_box

pytestmark = pytest.mark.xdist_group("kernels")


def unit_directions(rng: np.random.Generator, count: int) -> np.ndarray:
    rays = rng.normal(size=(count, 3))
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 400), flat=st.booleans())
def test_nearest_hits_agree_with_a_double_precision_caster(seed, count, flat):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-10, 10, (count, 1, 3)) + rng.normal(0, 2.0, (count, 3, 3))
    if flat:
        corners[..., 2] = np.round(corners[..., 2])
        corners[::2, :, 2] = corners[::2, :1, 2]
    corners = corners.astype(np.float32).astype(np.float64)
    directions = unit_directions(rng, 200).astype(np.float32).astype(np.float64)
    origin = rng.uniform(-12, 12, 3).astype(np.float32).astype(np.float64)
    hits = shoot(frame_of(soup(corners)), origin, directions)
    t, triangle, edge = moller_trumbore(corners, origin, directions)
    clear = edge > 1e-4
    assert np.array_equal(hits.triangle[clear], triangle[clear])
    met = clear & (triangle >= 0)
    assert np.allclose(hits.t[met], t[met], rtol=2e-4, atol=2e-4)
    assert np.all(hits.row[clear & (triangle < 0)] == NOTHING)


def test_weights_give_back_the_hit_point():
    rng = np.random.default_rng(3)
    corners = rng.uniform(-5, 5, (60, 3, 3)).astype(np.float32)
    directions = unit_directions(rng, 500)
    hits = shoot(frame_of(soup(corners)), np.zeros(3), directions)
    met = hits.row == STATIC
    assert met.sum() > 50
    u, v = hits.weights[met, :1], hits.weights[met, 1:]
    a, b, c = (corners[hits.triangle[met], k] for k in range(3))
    assert np.allclose(
        u * a + v * b + (1 - u - v) * c, hits.directions[met] * hits.t[met, None], atol=1e-3
    )


@pytest.mark.parametrize("scale", [1.0, 300.0])
def test_no_ray_leaks_out_of_a_closed_mesh(scale):
    mesh = sphere(4)
    corners = mesh.vertices[mesh.triangles] * np.float32(scale)
    rng = np.random.default_rng(8)
    origin = rng.uniform(-0.3, 0.3, 3) * scale
    # Straight at vertices, at the middle of edges, and anywhere.
    flat = corners.reshape(-1, 3)
    edges = (corners + np.roll(corners, 1, axis=1)).reshape(-1, 3) / 2
    targets = np.concatenate([flat, edges, flat * 0.3 + edges * 0.7])
    rays = np.concatenate([targets - origin, unit_directions(rng, 20_000)])
    hits = shoot(frame_of(soup(corners)), origin, rays)
    assert np.all(hits.row == STATIC)


def test_axis_parallel_rays_hit_axis_parallel_boxes():
    frame = frame_of(turned_box((2.0, 2.0, 2.0)))
    directions = np.concatenate([np.eye(3), -np.eye(3)])
    hits = shoot(frame, np.zeros(3), directions)
    assert np.allclose(hits.t, 1.0)
    # Along a face's own plane, from outside towards a corner line.
    assert shoot(frame, [-3.0, 0.999, 0.999], [[1.0, 0.0, 0.0]]).t[0] == pytest.approx(2.0)


def test_of_coincident_triangles_the_lowest_number_wins():
    rng = np.random.default_rng(1)
    one = np.array([[[5.0, -3, -3], [5, 3, -3], [5, 0, 4]]])
    filler = rng.uniform(20, 30, (50, 3, 3))
    corners = np.concatenate([filler[:25], one, one, filler[25:], one])
    hits = shoot(frame_of(soup(corners)), np.zeros(3), [[1.0, 0.0, 0.0]])
    assert hits.triangle[0] == 25


def test_static_geometry_wins_over_an_instance_and_low_rows_over_high_ones():
    wall = np.array([[[5.0, -3, -3], [5, 3, -3], [5, 0, 4]]])
    models = {"wall": soup(wall - [5.0, 0.0, 0.0])}
    placed = Placement(7, "wall", np.array([5.0, 0.0, 0.0]), np.eye(3))
    both = frame_of(soup(wall), [placed, placed], models)
    assert shoot(both, np.zeros(3), [[1.0, 0.0, 0.0]]).row[0] == STATIC
    actors = frame_of(None, [placed, placed], models)
    assert shoot(actors, np.zeros(3), [[1.0, 0.0, 0.0]]).row[0] == 0
    assert shoot(actors, np.zeros(3), [[1.0, 0.0, 0.0]], skip_row=0).row[0] == 1


def test_an_instance_is_hit_where_its_moved_mesh_would_be():
    rng = np.random.default_rng(5)
    mesh = sphere(1)
    rotation = rotation_matrix([20.0, 130.0, -40.0])
    location = np.array([100.0, -60.0, 3.0])
    frame = frame_of(None, [Placement(1, "ball", location, rotation)], {"ball": mesh})
    moved = mesh.vertices[mesh.triangles].astype(np.float64) @ rotation.T + location
    origin = location + np.array([4.0, 1.0, 0.5])
    directions = -unit_directions(rng, 2000) * 0.3 + (location - origin)
    hits = shoot(frame, origin, directions)
    t, triangle, edge = moller_trumbore(moved, origin, directions)
    clear = edge > 1e-3
    assert np.array_equal(hits.triangle[clear], triangle[clear])
    met = clear & (triangle >= 0)
    assert np.allclose(hits.t[met], t[met], rtol=1e-3)


def test_each_of_many_instances_is_hit_at_its_own_place():
    models = {"box": turned_box((1.0, 1.0, 1.0)), "ball": sphere(1)}
    rng = np.random.default_rng(2)
    places = rng.permutation(300)[:150]
    placements = [
        Placement(
            1000 + k,
            "box" if k % 3 else "ball",
            np.array([10.0, 4.0 * (place % 20), 4.0 * (place // 20)]),
            np.eye(3),
        )
        for k, place in enumerate(places)
    ]
    frame = frame_of(None, placements, models)
    for row, placement in enumerate(placements):
        origin = placement.location - [10.0, 0.013, 0.017]
        hit = shoot(frame, origin, [[1.0, 0.0, 0.0]])
        assert hit.row[0] == row
        assert frame.actor_id[hit.row[0]] == placement.actor_id


def test_rays_stop_at_the_far_end_and_start_at_the_near_one():
    frame = frame_of(turned_box((2.0, 2.0, 2.0)))
    ray = [[1.0, 0.0, 0.0]]
    assert shoot(frame, [-5.0, 0.1, 0.2], ray, high=3.9).row[0] == NOTHING
    assert shoot(frame, [-5.0, 0.1, 0.2], ray, high=4.1).t[0] == pytest.approx(4.0)
    assert shoot(frame, [-5.0, 0.1, 0.2], ray, low=4.5).t[0] == pytest.approx(6.0)


def test_an_empty_world_is_hit_by_nothing():
    assert shoot(frame_of(None), np.zeros(3), [[1.0, 0.0, 0.0]]).row[0] == NOTHING


def test_one_and_two_threads_give_identical_bytes():
    from carstage_sim.render.caster import RayCaster

    frame = frame_of(sphere(3))
    rays = unit_directions(np.random.default_rng(4), 20_000).astype(np.float32)
    one, two = RayCaster(1), RayCaster(2)
    first = one.cast(frame.scene, np.zeros(3), rays, low=0.01, high=10.0)
    second = two.cast(frame.scene, np.zeros(3), rays, low=0.01, high=10.0)
    two.close()
    for name in ("t", "row", "triangle", "weights"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


def test_no_threads_are_refused():
    from carstage_sim.render.caster import RayCaster

    with pytest.raises(ValueError, match="at least 1"):
        RayCaster(0)
