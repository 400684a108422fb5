"""Small worlds of a few triangles, and single cars to drive in them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.ground import Ground
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.contacts.obstacles import Obstacles
from carstage_sim.world.controls import VehicleControl
from carstage_sim.world.vehicles.fleet import VehicleFleet
from carstage_sim.world.vehicles.parameters import VehicleParameters

CAR = 7
DELTA_S = 0.05


def parameters(type_id: str = "vehicle.tesla.model3", **changed: Any) -> VehicleParameters:
    """Physics of a vehicle, with some fields changed."""
    found = catalogue()[type_id].vehicle
    assert found is not None
    return replace(found, **changed)


def sheet(
    low: tuple[float, float],
    high: tuple[float, float],
    height: Callable[[float, float], float] = lambda _x, _y: 0.0,
) -> TriangleMesh:
    """A rectangle of road."""
    (x0, y0), (x1, y1) = low, high
    plan = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    return build_mesh(
        np.array([(x, y, height(x, y)) for x, y in plan]),
        np.array([[0, 1, 2], [0, 2, 3]]),
        Material.ASPHALT,
        CityObjectLabel.ROADS,
    )


def wall(
    start: tuple[float, float],
    end: tuple[float, float],
    *,
    object_id: int = 1,
    base_m: float = 0.0,
    label: CityObjectLabel = CityObjectLabel.WALLS,
) -> TriangleMesh:
    """An upright sheet of 3 m."""
    (x0, y0), (x1, y1) = start, end
    top = base_m + 3.0
    return build_mesh(
        np.array([(x0, y0, base_m), (x1, y1, base_m), (x1, y1, top), (x0, y0, top)]),
        np.array([[0, 1, 2], [0, 2, 3]]),
        Material.CONCRETE,
        label,
        object_id=object_id,
    )


def plain(*more: TriangleMesh) -> TriangleMesh:
    """A large flat road with something on it."""
    return merge_meshes([sheet((-500.0, -500.0), (500.0, 500.0)), *more])


def hills() -> TriangleMesh:
    """A plain, and from x = 0 on a road that waves by half a metre up and down every 40 m."""
    wave = [
        sheet((x, -50.0), (x + 2.0, 50.0), lambda px, _y: 0.5 * math.sin(px * 2.0 * math.pi / 40.0))
        for x in np.arange(-20.0, 400.0, 2.0)
    ]
    return merge_meshes([sheet((-500.0, -500.0), (-20.0, 500.0)), *wave])


def fleet_on(mesh: TriangleMesh) -> VehicleFleet:
    """An empty fleet in a world of triangles."""
    ground = Ground(mesh)
    return VehicleFleet(ground.height_below, Obstacles(mesh, ground))


def one_car(
    mesh: TriangleMesh | None = None,
    *,
    physics: VehicleParameters | None = None,
    at: tuple[float, float, float] = (0.0, 0.0, 0.0),
    yaw_deg: float = 0.0,
) -> VehicleFleet:
    """A fleet of one car that stands on the ground."""
    fleet = VehicleFleet() if mesh is None else fleet_on(mesh)
    fleet.add(CAR, physics or parameters(), at, (0.0, yaw_deg, 0.0))
    fleet.step(DELTA_S, 5)
    return fleet


def drive(fleet: VehicleFleet, seconds: float, **control: Any) -> None:
    """Drives the car with constant pedals."""
    fleet.set_control(CAR, VehicleControl(**control))
    for _ in range(round(seconds / DELTA_S)):
        fleet.step(DELTA_S, 3)


def rolling(speed: float, **options: Any) -> VehicleFleet:
    """One car that rolls along x."""
    fleet = one_car(**options)
    fleet.set_target_velocity(CAR, (speed, 0.0, 0.0))
    return fleet


def turned_deg(fleet: VehicleFleet) -> float:
    """How far the car looks away from x."""
    return abs(math.remainder(float(fleet.rotation_deg[0, 1]), 360.0))
