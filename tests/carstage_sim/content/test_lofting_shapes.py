"""Curves do not overshoot, smoothing respects creases."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from carstage_sim.content.lofting import Curve, ShapeBuilder, smooth_normals
from carstage_sim.mesh import Material


@settings(max_examples=50, deadline=None)
@given(
    steps=st.lists(st.floats(0.01, 2.0), min_size=2, max_size=8),
    data=st.data(),
)
def test_a_curve_meets_its_points_and_stays_between_neighbours(steps, data):
    x = np.cumsum(steps)
    y = np.array(data.draw(st.lists(st.floats(-5, 5), min_size=len(x), max_size=len(x))))
    curve = Curve(list(zip(x.tolist(), y.tolist(), strict=True)))
    assert np.allclose(curve(x), y, atol=1e-9)
    for k in range(len(x) - 1):
        between = curve(np.linspace(x[k], x[k + 1], 9)[1:-1])
        inner = 0 < k < len(x) - 2
        if inner:
            assert between.min() >= min(y[k], y[k + 1]) - 1e-9
            assert between.max() <= max(y[k], y[k + 1]) + 1e-9


def test_a_curve_needs_rising_points():
    with pytest.raises(ValueError, match="rising"):
        Curve([(0.0, 1.0), (0.0, 2.0)])


def test_normals_are_smoothed_up_to_the_crease_angle():
    # A flat roof of two faces that meet at 30 degrees.
    tilt = np.radians(30.0)
    points = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [-np.cos(tilt), 0, -np.sin(tilt)]], float)
    triangles = np.array([[0, 2, 1], [0, 1, 3]], np.int32)
    soft = smooth_normals(points, triangles, crease_deg=40.0)
    hard = smooth_normals(points, triangles, crease_deg=20.0)
    assert np.allclose(soft[0, 0], soft[1, 0])
    assert np.degrees(np.arccos(hard[0, 0] @ hard[1, 0])) == pytest.approx(30.0, abs=1e-6)


def test_a_limb_is_closed():
    builder = ShapeBuilder(4)
    builder.limb([(0, 0, 0), (0, 0, 1.0)], [0.2, 0.1], Material.SKIN, sides=6)
    mesh = builder.mesh()
    places = np.unique(np.round(mesh.vertices, 5), axis=0, return_inverse=True)[1].reshape(-1)
    corner = places[mesh.triangles]
    edges = np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]])
    _, counts = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    assert np.all(counts == 2)
