"""Vehicles of the catalogue from several sides, by day and by night with their lamps on."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.render.sheets import (
    DAY,
    NIGHT,
    Shot,
    Vector,
    around,
    colours,
    pictures_of,
)
from carstage_sim.content.vehicles import vehicle_mesh
from carstage_sim.mesh import TriangleMesh
from carstage_sim.render.scene import Placement
from carstage_sim.world.blueprints import Blueprint, catalogue
from carstage_sim.world.state import Weather

_BY_DAY = (
    "tesla.model3", "seat.leon", "nissan.patrol", "dodge.charger_police", "mercedes.sprinter",
    "ford.ambulance", "mitsubishi.fusorosa", "carlamotors.european_hgv", "carlamotors.firetruck",
    "tesla.cybertruck", "kawasaki.ninja", "harley-davidson.low_rider", "vespa.zx125",
    "gazelle.omafiets",
)  # fmt: skip
_BY_NIGHT = ("dodge.charger_police", "mitsubishi.fusorosa")
_SIDES_DEG = {"ahead": 30.0, "side": 90.0, "behind": 150.0}
_FOV_DEG = 34.0
_BEAMS_BRAKES_SIGNALS_BEACONS = 1 | 2 | 8 | 16 | 512


def _mesh(name: str) -> TriangleMesh:
    blueprint = catalogue()[name]
    parameters = blueprint.vehicle
    if parameters is None:
        raise ValueError(f"{name} is no vehicle")
    return vehicle_mesh(
        name,
        blueprint.box_extent,
        blueprint.box_center,
        axles_m=(parameters.front_axle_x_m, parameters.rear_axle_x_m),
        wheel_radius_m=parameters.wheels[0].radius_m,
    )


def _paint(blueprint: Blueprint) -> tuple[int, int, int]:
    """The first colour that a blueprint recommends."""
    for attribute in blueprint.attributes:
        if attribute.id == "color":
            red, green, blue = (int(part) for part in attribute.recommended[0].split(","))
            return red, green, blue
    return 128, 128, 128


def _shot(name: str, side: str, weather: Weather, aspect: float) -> Shot:
    blueprint = catalogue()[f"vehicle.{name}"]
    lit = weather is NIGHT
    place = Placement(
        1, blueprint.id, np.zeros(3), np.eye(3), colours(blueprint.id, _paint(blueprint)),
        _BEAMS_BRAKES_SIGNALS_BEACONS if lit else 0,
    )  # fmt: skip
    eye, rotation = _viewpoint(blueprint, _SIDES_DEG[side], aspect)
    label = f"{name}, lamps on" if lit else name
    return Shot(f"{label}, {side}", [place], eye, rotation, _FOV_DEG, weather)


def vehicle_pictures(width: int, height: int) -> dict[str, NDArray[np.uint8]]:
    """A picture of each vehicle and side, by name; the night's behind the day's, 48 in all."""
    shots = [
        _shot(name, side, weather, width / height)
        for weather, names in ((DAY, _BY_DAY), (NIGHT, _BY_NIGHT))
        for name in names
        for side in _SIDES_DEG
    ]
    return pictures_of(shots, _mesh, width, height)


def _viewpoint(blueprint: Blueprint, turn_deg: float, aspect: float) -> tuple[Vector, Vector]:
    """An eye from which a vehicle fills the picture, and where it looks."""
    (hx, hy, hz), (cx, _, cz) = blueprint.box_extent, blueprint.box_center
    turn = math.radians(turn_deg)
    wide = abs(hx * math.sin(turn)) + abs(hy * math.cos(turn))
    deep = abs(hx * math.cos(turn)) + abs(hy * math.sin(turn))
    reach = max(wide, hz * aspect * 1.15)
    away = deep + 1.12 * reach / math.tan(math.radians(_FOV_DEG) / 2.0)
    return around((cx, 0.0, cz * 0.95), away, turn_deg, max(1.5, 0.62 * 2.0 * hz))
