"""Pedestrians of the catalogue from several sides, standing, walking, running, by day and night."""

from __future__ import annotations

from collections.abc import Iterator

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
from carstage_sim.content.pedestrians import pedestrian_mesh, walking_joints
from carstage_sim.content.walking import WALK_PHASES
from carstage_sim.geometry import rotation_matrix
from carstage_sim.mesh import TriangleMesh
from carstage_sim.render.scene import QUICK, Placement
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.state import Weather

_STANDING = (1, 2, 4, 16, 20, 12)
_ASIDE = (5, 18, 8, 27, 9, 32)
_BEHIND = (3, 7, 19, 15, 10, 17)
_WALKING, _RUNNING = 21, 6
_FOV_DEG = 36.0


def _mesh(key: str) -> TriangleMesh:
    name, _, phase = key.partition(QUICK)
    extent = catalogue()[name].box_extent
    return pedestrian_mesh(name, extent, walking_joints(name, extent, int(phase)))


def _placed(number: int, phase: int, at: tuple[float, float], yaw_deg: float) -> Placement:
    name = f"walker.pedestrian.{number:04d}"
    half = catalogue()[name].box_extent[2]
    return Placement(
        number, f"{name}{QUICK}{phase}", np.array([*at, half]),
        rotation_matrix((0.0, yaw_deg, 0.0)), colours(name),
    )  # fmt: skip


def _crowd(weather: Weather, away: float) -> Shot:
    random = np.random.default_rng(7)
    people = [
        _placed(
            number, int(random.integers(0, WALK_PHASES + 1)),
            (float(random.uniform(-3.0, 3.0)), float(random.uniform(-0.13, 0.13) * away)),
            float(random.choice([0.0, 90.0, 180.0, 270.0]) + random.uniform(-20.0, 20.0)),
        )
        for number in range(1, 12)
    ]  # fmt: skip
    eye, rotation = around((0.0, 0.0, 1.1), away, 0.0, 1.6)
    when = "day" if weather is DAY else "night"
    return Shot(f"{away:.0f} m, {when}", people, eye, rotation, _FOV_DEG, weather)


def _shots() -> Iterator[Shot]:
    def portrait(number: int, phase: int, turn_deg: float, name: str, weather: Weather) -> Shot:
        person = _placed(number, phase, (0.0, 0.0), 0.0)
        middle: Vector = (0.0, 0.0, float(person.location[2]))
        # Children as large in the picture as others.
        eye, rotation = around(middle, 3.66 * middle[2], turn_deg, 1.5 * middle[2])
        return Shot(name, [person], eye, rotation, _FOV_DEG, weather)

    for number in _STANDING:
        yield portrait(number, 0, 15.0, f"{number:04d}", DAY)
    for number in _ASIDE:
        yield portrait(number, 2, 80.0, f"{number:04d}, aside", DAY)
    for number in _BEHIND:
        yield portrait(number, 26, 160.0, f"{number:04d}, behind", DAY)
    for step in range(6):
        yield portrait(_WALKING, 1 + 8 * step, 90.0, f"walk, {step + 1} of 6", DAY)
    for step in range(3):
        yield portrait(_RUNNING, WALK_PHASES + 1 + 10 * step, 90.0, f"run, {step + 1} of 3", DAY)
    yield _crowd(DAY, 10.0)
    yield _crowd(DAY, 25.0)
    yield _crowd(NIGHT, 10.0)


def people_pictures(width: int, height: int) -> dict[str, NDArray[np.uint8]]:
    """Pictures of the sheet by their names, 30 in all."""
    return pictures_of(list(_shots()), _mesh, width, height)
