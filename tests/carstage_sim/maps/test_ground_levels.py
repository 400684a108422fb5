"""The ground under a point, where several surfaces lie above each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.ground import STEP_UP_M, Ground
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes


def sheet(low: tuple[float, float], high: tuple[float, float], z: NDArray[np.float64] | float):
    """A rectangle of two triangles; ``z`` are the heights of its four corners."""
    (x0, y0), (x1, y1) = low, high
    plan = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    heights = np.broadcast_to(np.asarray(z, np.float64), (4,))
    return build_mesh(
        np.column_stack([plan, heights]),
        np.array([[0, 1, 2], [0, 2, 3]]),
        Material.ASPHALT,
        CityObjectLabel.ROADS,
    )


def bridge_over_road() -> TriangleMesh:
    road = sheet((-50.0, -50.0), (50.0, 50.0), 0.0)
    deck = sheet((-50.0, -5.0), (50.0, 5.0), 6.0)
    return merge_meshes([road, deck])


@pytest.mark.parametrize(
    ("z", "expected"), [(0.0, 0.0), (4.0, 0.0), (5.5, 6.0), (6.0, 6.0), (9.0, 6.0)]
)
def test_a_bridge_carries_what_is_on_it_and_not_what_is_under_it(z: float, expected: float) -> None:
    ground = Ground(bridge_over_road())
    assert ground.height_below(np.array([[3.0, 1.0, z]])) == pytest.approx([expected])
    assert ground.highest(np.array([[3.0, 1.0]])) == pytest.approx([6.0])


def test_what_is_below_every_surface_has_no_ground() -> None:
    ground = Ground(bridge_over_road())
    places = np.array([[0.0, 0.0, -STEP_UP_M - 0.01], [0.0, 80.0, 5.0], [1e6, 0.0, 5.0]])
    assert np.isnan(ground.height_below(places)).all()
    assert np.isnan(ground.surface_below(places)[1]).all()
    assert len(ground.height_below(np.zeros((0, 3)))) == 0


def test_walls_and_what_is_no_ground_carry_nothing() -> None:
    wall = build_mesh(
        np.array([[0.0, 0.0, 0.0], [4.0, 0.1, 0.0], [4.0, 0.0, 3.0]]),
        np.array([[0, 1, 2]]),
        Material.KERB,
        CityObjectLabel.SIDEWALKS,
    )
    roof = build_mesh(
        np.array([[0.0, 0.0, 3.0], [4.0, 0.0, 3.0], [4.0, 4.0, 3.0]]),
        np.array([[0, 1, 2]]),
        Material.ROOF,
        CityObjectLabel.BUILDINGS,
    )
    ground = Ground(merge_meshes([wall, roof]))
    assert np.isnan(ground.highest(np.array([[3.0, 0.05], [3.0, 1.0]]))).all()


corner = st.tuples(
    st.floats(-30.0, 30.0, width=32), st.floats(-30.0, 30.0, width=32), st.floats(-3.0, 3.0)
)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=8), st.integers(0, 1000))
def test_heights_and_normals_are_those_of_every_triangle_looked_at_alone(
    triangles: list[tuple[tuple[float, float, float], ...]], seed: int
) -> None:
    corners = np.array(triangles, np.float32).astype(np.float64)
    mesh = build_mesh(
        corners.reshape(-1, 3),
        np.arange(3 * len(corners)).reshape(-1, 3),
        Material.ASPHALT,
        CityObjectLabel.ROADS,
    )
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1)
    flat = (np.abs(normals[:, 2]) > 0.51 * size) & (np.abs(normals[:, 2]) > 1.0)
    if not np.array_equal(flat, np.abs(normals[:, 2]) > 0.49 * np.maximum(size, 1e-12)):
        return  # on the edge of being steep, or a sliver: both answers are right
    points = np.random.default_rng(seed).uniform(-30.0, 30.0, (40, 3))
    points[:, 2] /= 6.0
    height, normal = Ground(mesh).surface_below(points, 0.5)
    for point, found, upward in zip(points, height, normal, strict=True):
        best, best_normal = -np.inf, None
        for triangle in np.flatnonzero(flat):
            a, b, c = corners[triangle]
            weights = np.linalg.solve(
                np.stack([a[:2] - c[:2], b[:2] - c[:2]], 1), point[:2] - c[:2]
            )
            least = min(*weights, 1.0 - weights.sum())
            z = float(weights @ [a[2] - c[2], b[2] - c[2]] + c[2])
            if abs(least) < 1e-5 or abs(z - point[2] - 0.5) < 1e-5:
                return  # on an edge
            if least > 0.0 and best < z <= point[2] + 0.5:
                best, best_normal = z, normals[triangle]
        if best_normal is None:
            assert np.isnan(found)
        else:
            assert found == pytest.approx(best, abs=1e-6)
            toward = best_normal * np.sign(best_normal[2]) / np.linalg.norm(best_normal)
            assert upward == pytest.approx(toward, abs=1e-6)
