"""Street lamps and headlights: found in the scene, lit by night, aimed forwards."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.street_lamps import street_lamps
from carstage_sim.mesh import Material, build_mesh, merge_meshes
from carstage_sim.render.lamps import CELL_M, headlight_beams, lamps_of
from carstage_sim.render.scene import Placement
from ray_scenes import frame_of, turned_box

pytestmark = pytest.mark.xdist_group("kernels")


def lamp_at(x, y, z=7.0):
    box = turned_box((0.6, 0.3, 0.1))
    return build_mesh(
        box.vertices + np.array([x, y, z]), box.triangles, Material.STREET_LAMP,
        CityObjectLabel.POLES,
    )  # fmt: skip


def test_each_lamp_is_found_once_and_near_its_cell():
    places = [(0.0, 0.0), (60.3, 11.1), (-41.0, 90.7)]
    lamps = lamps_of(street_lamps(merge_meshes([lamp_at(x, y) for x, y in places])))
    distance = np.hypot(*(lamps.street[:, None, :2] - np.array(places)).transpose(2, 0, 1))
    assert distance.min(axis=0).max() < 0.5
    for x, y in places:
        i, j = np.floor((np.array([x, y]) - lamps.corner) / CELL_M).astype(int)
        near = lamps.cells[i, j]
        offsets = lamps.street[near[near >= 0], :2] - [x, y]
        assert np.hypot(*offsets.T).min() < 0.5


def test_a_town_without_lamps_has_none():
    assert len(street_lamps(None)) == 0
    assert len(street_lamps(turned_box((1.0, 1.0, 1.0)))) == 0


def test_beams_start_at_the_front_of_vehicles_with_lights_on():
    car = {"car": build_mesh(
        turned_box((4.0, 1.8, 1.5)).vertices + np.array([0.0, 0.0, 0.75]),
        turned_box((1.0, 1.0, 1.0)).triangles, Material.PAINT, CityObjectLabel.CAR,
    )}  # fmt: skip
    turned = rotation_matrix([0.0, 90.0, 0.0])
    placements = [
        Placement(1, "car", np.array([10.0, 0.0, 0.0]), turned, light_state=2),
        Placement(2, "car", np.array([20.0, 0.0, 0.0]), turned, light_state=8),
    ]
    beams = frame_of(None, placements, car).lamps.beams
    assert beams.shape == (1, 6)
    assert beams[0, :3].tolist() == pytest.approx([10.0, 2.0, 0.65], abs=1e-5)
    assert beams[0, 4] > 0.99
    assert beams[0, 5] < 0


def test_a_traffic_light_state_is_no_headlight():
    narrow = np.array([[[-0.3, -0.3, 0.0], [0.3, 0.3, 5.0]]], np.float32)
    none = headlight_beams(
        np.eye(3, dtype=np.float32)[None], np.zeros((1, 3), np.float32), narrow,
        np.array([2], np.uint32),
    )  # fmt: skip
    assert len(none) == 0
