"""Vehicles of the catalogue from several sides, by day and by night with their lamps on."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.render.sheets import (
    DAY,
    FROM_AHEAD,
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
from carstage_sim.world.state import ActorKind, Weather

_BY_DAY = (
    "tesla.model3", "seat.leon", "nissan.patrol", "dodge.charger_police", "mercedes.sprinter",
    "ford.ambulance", "mitsubishi.fusorosa", "carlamotors.european_hgv", "carlamotors.firetruck",
    "tesla.cybertruck", "kawasaki.ninja", "harley-davidson.low_rider", "vespa.zx125",
    "gazelle.omafiets",
)  # fmt: skip
_BY_NIGHT = ("dodge.charger_police", "mitsubishi.fusorosa")
_SIDES_DEG = {"ahead": 30.0, "side": 90.0, "behind": 150.0}
_FOUR_SIDES_DEG = {"front": 0.0, "corner": 35.0, "side": 90.0, "rear": 180.0}
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


def _paint(blueprint: Blueprint, turn: int = 0) -> tuple[int, int, int]:
    """One of the colours that a blueprint recommends; they are taken in turn."""
    for attribute in blueprint.attributes:
        if attribute.id == "color":
            offered = attribute.recommended
            red, green, blue = (int(part) for part in offered[turn % len(offered)].split(","))
            return red, green, blue
    return 128, 128, 128


def _shot(
    name: str, side: str, turn_deg: float, weather: Weather, aspect: float, paint: int = 0
) -> Shot:
    blueprint = catalogue()[f"vehicle.{name}"]
    lit = weather is NIGHT
    place = Placement(
        1, blueprint.id, np.zeros(3), np.eye(3), colours(blueprint.id, _paint(blueprint, paint)),
        _BEAMS_BRAKES_SIGNALS_BEACONS if lit else 0,
    )  # fmt: skip
    eye, rotation = _viewpoint(blueprint, turn_deg, aspect)
    label = f"{name}, lamps on" if lit else name
    return Shot(f"{label}, {side}", [place], eye, rotation, _FOV_DEG, weather)


def vehicle_pictures(width: int, height: int) -> dict[str, NDArray[np.uint8]]:
    """A picture of each vehicle and side, by name; the night's behind the day's, 48 in all."""
    shots = [
        _shot(name, side, turn_deg, weather, width / height)
        for weather, names in ((DAY, _BY_DAY), (NIGHT, _BY_NIGHT))
        for name in names
        for side, turn_deg in _SIDES_DEG.items()
    ]
    return pictures_of(shots, _mesh, width, height)


def every_vehicle(width: int, height: int) -> Iterator[tuple[str, list[NDArray[np.uint8]]]]:
    """Each vehicle of the catalogue by day from four sides: front, corner, side and rear."""
    vehicles = [one for one in catalogue().values() if one.kind == ActorKind.VEHICLE]
    for number, blueprint in enumerate(vehicles):
        name = blueprint.id.removeprefix("vehicle.")
        shots = [
            _shot(name, side, turn_deg, FROM_AHEAD, width / height, number)
            for side, turn_deg in _FOUR_SIDES_DEG.items()
        ]
        yield blueprint.id, list(pictures_of(shots, _mesh, width, height).values())


def _viewpoint(blueprint: Blueprint, turn_deg: float, aspect: float) -> tuple[Vector, Vector]:
    """An eye from which a vehicle fills the picture, and where it looks."""
    (hx, hy, hz), (cx, _, cz) = blueprint.box_extent, blueprint.box_center
    turn = math.radians(turn_deg)
    wide = abs(hx * math.sin(turn)) + abs(hy * math.cos(turn))
    deep = abs(hx * math.cos(turn)) + abs(hy * math.sin(turn))
    reach = max(wide, hz * aspect * 1.15)
    away = deep + 1.12 * reach / math.tan(math.radians(_FOV_DEG) / 2.0)
    return around((cx, 0.0, cz * 0.95), away, turn_deg, max(1.5, 0.62 * 2.0 * hz))
