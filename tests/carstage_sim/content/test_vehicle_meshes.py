"""Every vehicle of the catalogue lies in its box, stands on the ground and is tagged rightly."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.content.vehicles import vehicle_mesh
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.state import ActorKind

VEHICLES = [b for b in catalogue().values() if b.kind == ActorKind.VEHICLE]
_CENTIMETRE = 0.01


def mesh_of(blueprint):
    return vehicle_mesh(
        blueprint.id,
        blueprint.box_extent,
        blueprint.box_center,
        axles_m=(blueprint.vehicle.front_axle_x_m, blueprint.vehicle.rear_axle_x_m),
        wheel_radius_m=blueprint.vehicle.wheels[0].radius_m,
    )


@pytest.mark.parametrize("blueprint", VEHICLES, ids=lambda b: b.id)
def test_vehicle_keeps_its_box_budget_and_tags(blueprint):
    mesh = mesh_of(blueprint)
    center, extent = np.array(blueprint.box_center), np.array(blueprint.box_extent)
    low, high = mesh.bounds
    assert np.all(low >= center - extent - _CENTIMETRE)
    assert np.all(high <= center + extent + _CENTIMETRE)
    assert low[2] == pytest.approx(max(center[2] - extent[2], 0.0), abs=0.02)
    # The box is filled, or boxes drawn on pictures would look wrong.
    ground = max(center[2] - extent[2], 0.0)
    assert high[0] - low[0] > 1.9 * extent[0] - 0.06
    assert high[2] > ground + 0.95 * (center[2] + extent[2] - ground) - 0.03
    assert len(mesh.triangles) <= 6000
    assert set(mesh.tag.tolist()) == set(blueprint.semantic_tags)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=2), 1.0, atol=1e-3)


@pytest.mark.parametrize(
    "material",
    [
        Material.GLASS,
        Material.RUBBER,
        Material.HEAD_LAMP,
        Material.TAIL_LAMP,
        Material.BLINKER_LEFT,
        Material.BLINKER_RIGHT,
        Material.PAINT,
        Material.LICENCE_PLATE,
    ],
)
def test_a_car_has_windows_wheels_and_lamps(material):
    mesh = mesh_of(catalogue()["vehicle.tesla.model3"])
    assert (mesh.material == material).any()


def test_lamps_sit_at_their_ends_and_sides():
    mesh = mesh_of(catalogue()["vehicle.audi.tt"])
    middle = mesh.vertices[mesh.triangles].mean(axis=1)
    assert middle[mesh.material == Material.HEAD_LAMP, 0].min() > 1.5
    assert middle[mesh.material == Material.TAIL_LAMP, 0].max() < -1.5
    assert middle[mesh.material == Material.BLINKER_LEFT, 1].max() < 0
    assert middle[mesh.material == Material.BLINKER_RIGHT, 1].min() > 0


def test_bodies_are_symmetric():
    mesh = mesh_of(catalogue()["vehicle.seat.leon"])
    low, high = mesh.bounds
    assert low[1] == pytest.approx(-high[1], abs=1e-3)


def test_an_unknown_vehicle_becomes_a_car():
    mesh = vehicle_mesh("vehicle.unknown.one", (2.2, 0.95, 0.75), (0.0, 0.0, 0.75))
    assert set(mesh.tag.tolist()) == {CityObjectLabel.CAR}
