"""The figures of the check ``render`` mean what they claim."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.simulator.render.grounding import GroundProbe, lowest_vertices
from benchmarks.simulator.render.looks import lab, shadow_error_deg
from benchmarks.simulator.render.scene import named_presets, town_of
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, build_mesh

pytestmark = pytest.mark.xdist_group("kernels")


def test_colours_are_those_of_the_standard():
    codes = np.array([[255, 255, 255], [0, 0, 0], [255, 0, 0]], np.uint8)
    expected = [[100.0, 0.0, 0.0], [0.0, 0.0, 0.0], [53.2, 80.1, 67.2]]
    assert lab(codes) == pytest.approx(np.array(expected), abs=0.2)


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
    assert gaps == pytest.approx([0.2, 0.0, -2.5], abs=0.51)
    assert gaps[:2] == pytest.approx([0.2, 0.0], abs=1e-3)
    assert gaps[2] < 0


@pytest.mark.parametrize("town", ["Stage01", "Stage02", "Stage03"])
def test_nothing_of_a_town_hangs_above_its_ground(town):
    mesh = town_of(town).static_mesh
    gaps = GroundProbe(mesh)(lowest_vertices(mesh))
    assert len(gaps) > 500
    assert gaps.max() < 0.03


def test_the_shadow_of_a_pole_points_away_from_the_sun():
    assert shadow_error_deg() <= 2.0
