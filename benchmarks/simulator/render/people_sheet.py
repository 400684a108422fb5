"""Pedestrians of the catalogue from several sides, standing, walking, running, by day and night."""

from __future__ import annotations

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
from carstage_sim.content.pedestrians import pedestrian_mesh, walking_joints
from carstage_sim.content.people import COUNT
from carstage_sim.content.walking import WALK_PHASES
from carstage_sim.content.wheelchairs import EXTENT, seated_joints, wheelchair_mesh
from carstage_sim.geometry import rotation_matrix
from carstage_sim.mesh import TriangleMesh
from carstage_sim.render.scene import QUICK, Placement
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.state import Weather

_STANDING = (1, 2, 4, 16, 20, 12)
_ASIDE = (5, 18, 8, 27, 9, 32)
_BEHIND = (3, 7, 19, 15, 10, 17)
_WALKING, _RUNNING = 16, 6
_IN_RAIN = (4, 25, 21)
_FOV_DEG = 36.0
_UMBRELLA, _WHEELCHAIR = "+umbrella", "+wheelchair"
_CHILDREN = (48, 13, 9)
_SITTING = ((1, 4, 15.0), (3, 12, 80.0), (20, 36, 160.0))
_RAIN = Weather(
    sun_altitude_angle=45.0, sun_azimuth_angle=50.0, cloudiness=90.0, precipitation=60.0,
    precipitation_deposits=50.0, wetness=80.0,
)  # fmt: skip


def person_mesh(key: str) -> TriangleMesh:
    """The mesh of a figure in a phase of its motion, by its model's key."""
    figure, _, phase = key.partition(QUICK)
    name, _, _ = figure.partition("+")
    if figure.endswith(_WHEELCHAIR):
        return wheelchair_mesh(name, seated_joints(int(phase)), int(phase))
    extent = catalogue()[name].box_extent
    joints = walking_joints(name, extent, int(phase))
    return pedestrian_mesh(name, extent, joints, umbrella=figure != name)


def _placed(
    number: int, phase: int, at: tuple[float, float], yaw_deg: float, *, rain: bool = False
) -> Placement:
    name = f"walker.pedestrian.{number:04d}"
    half = catalogue()[name].box_extent[2]
    return Placement(
        number, f"{name}{_UMBRELLA if rain else ''}{QUICK}{phase}", np.array([*at, half]),
        rotation_matrix((0.0, yaw_deg, 0.0)), colours(name),
    )  # fmt: skip


def _sitting(number: int, phase: int, turn_deg: float) -> Shot:
    name = f"walker.pedestrian.{number:04d}"
    model = f"{name}{_WHEELCHAIR}{QUICK}{phase}"
    at, rotation = np.array([0.0, 0.0, EXTENT[2]]), rotation_matrix((0.0, 0.0, 0.0))
    person = Placement(number, model, at, rotation, colours(name))
    eye, view = around((0.0, 0.0, EXTENT[2]), 3.3, turn_deg, 1.4)
    return Shot(f"{number:04d}, in a wheelchair", [person], eye, view, _FOV_DEG, FROM_AHEAD)


def _crowd(weather: Weather, away: float, when: str) -> Shot:
    random = np.random.default_rng(7)
    people = [
        _placed(
            number, int(random.integers(0, WALK_PHASES + 1)),
            (float(random.uniform(-3.0, 3.0)), float(random.uniform(-0.13, 0.13) * away)),
            float(random.choice([0.0, 90.0, 180.0, 270.0]) + random.uniform(-20.0, 20.0)),
            rain=weather is _RAIN,
        )
        for number in range(1, 12)
    ]  # fmt: skip
    eye, rotation = around((0.0, 0.0, 1.1), away, 0.0, 1.6)
    return Shot(f"{away:.0f} m, {when}", people, eye, rotation, _FOV_DEG, weather)


def _portrait(number: int, phase: int, turn_deg: float, name: str, weather: Weather = DAY) -> Shot:
    person = _placed(number, phase, (0.0, 0.0), 0.0, rain=weather is _RAIN)
    middle: Vector = (0.0, 0.0, float(person.location[2]))
    # Children as large in the picture as others.
    eye, rotation = around(middle, 3.66 * middle[2], turn_deg, 1.5 * middle[2])
    return Shot(name, [person], eye, rotation, _FOV_DEG, weather)


def people_shots() -> Iterator[Shot]:
    """Who is shown from where, picture by picture."""
    for number in _STANDING:
        yield _portrait(number, 0, 15.0, f"{number:04d}")
    for number in _ASIDE:
        yield _portrait(number, 2, 80.0, f"{number:04d}, aside")
    for number in _BEHIND:
        yield _portrait(number, 26, 160.0, f"{number:04d}, behind")
    for step in range(6):
        yield _portrait(_WALKING, 1 + 8 * step, 90.0, f"walk, {step + 1} of 6")
    for step in range(3):
        yield _portrait(_RUNNING, WALK_PHASES + 1 + 10 * step, 90.0, f"run, {step + 1} of 3")
    yield _crowd(DAY, 10.0, "day")
    yield _crowd(DAY, 25.0, "day")
    yield _crowd(NIGHT, 10.0, "night")
    for number, turn_deg in zip(_IN_RAIN, (15.0, 80.0, 160.0), strict=True):
        yield _portrait(number, 2, turn_deg, f"{number:04d}, in rain", _RAIN)
    yield _portrait(_IN_RAIN[0], 0, 15.0, f"{_IN_RAIN[0]:04d}, dry", DAY)
    for number, phase, turn_deg in _SITTING:
        yield _sitting(number, phase, turn_deg)
    for number, turn_deg in zip(_CHILDREN, (15.0, 80.0, 15.0), strict=True):
        yield _portrait(number, 0, turn_deg, f"{number:04d}", FROM_AHEAD)
    yield _crowd(_RAIN, 6.0, "rain")
    yield _crowd(_RAIN, 15.0, "rain")


def people_pictures(width: int, height: int) -> dict[str, NDArray[np.uint8]]:
    """Pictures of the sheet by their names, 42 in all."""
    return pictures_of(list(people_shots()), person_mesh, width, height)


def every_pedestrian(width: int, height: int) -> Iterator[tuple[str, list[NDArray[np.uint8]]]]:
    """Each pedestrian of the catalogue standing and walking: front, side and back."""
    for number in range(1, COUNT + 1):
        shots = [
            _portrait(number, phase, turn_deg, str(turn_deg), FROM_AHEAD)
            for phase, turn_deg in ((0, 15.0), (2, 90.0), (26, 160.0))
        ]
        pictures = pictures_of(shots, person_mesh, width, height)
        yield f"walker.pedestrian.{number:04d}", list(pictures.values())
