"""Actors of the catalogue one by one in a yard, from several sides: sheets of the gallery."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.people import colours_of
from carstage_sim.content.solids import box
from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material, TriangleMesh, merge_meshes
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.picture import Picture, PictureMaker
from carstage_sim.render.scene import Placement, SceneStore
from carstage_sim.sensors.view import Camera, pixel_rays
from carstage_sim.world.state import Weather

_WORN = ("upper", "lower", "skin", "hair", "accent", "shoes", "bag")

DAY = Weather(sun_altitude_angle=45.0, sun_azimuth_angle=200.0, cloudiness=20.0)
FROM_AHEAD = Weather(sun_altitude_angle=38.0, sun_azimuth_angle=50.0, cloudiness=20.0)
"""Sun on the front and one side of who looks along x."""
NIGHT = Weather(sun_altitude_angle=-40.0, cloudiness=20.0)

Vector = tuple[float, float, float]
Colour = tuple[int, int, int]


class Shot(NamedTuple):
    """One picture of a sheet.

    Attributes:
        name: what stands on it.
        placements: what is seen.
        eye, rotation_deg, fov_deg: from where: metres, pitch, yaw and roll, and how wide.
        weather: by day or by night.
    """

    name: str
    placements: Sequence[Placement]
    eye: Vector
    rotation_deg: Vector
    fov_deg: float
    weather: Weather


def colours(type_id: str, paint: Colour = (128, 128, 128)) -> tuple[Colour, ...]:
    """Paint and clothes of an actor with the id 1, in the order of a placement's."""
    worn = colours_of(type_id, 1)
    return (paint, *(worn[name] for name in _WORN))


def yard() -> TriangleMesh:
    """A place of asphalt with walls around it."""
    parts = [box((0, 0, -0.5), (60, 60, 0.5), Material.ASPHALT, CityObjectLabel.ROADS)]
    for x, y, material in (
        (26, 0, Material.BRICK), (-26, 0, Material.PLASTER),
        (0, 26, Material.BRICK), (0, -26, Material.PLASTER),
    ):  # fmt: skip
        half = (0.5, 26, 3.0) if x else (26, 0.5, 3.0)
        parts.append(box((x, y, 3.0), half, material, CityObjectLabel.BUILDINGS))
    return merge_meshes(parts)


def pictures_of(
    shots: Sequence[Shot], mesh_of: Callable[[str], TriangleMesh], width: int, height: int
) -> dict[str, NDArray[np.uint8]]:
    """The pictures of shots by their names; ``mesh_of`` gives the mesh of a placement's model."""
    store = SceneStore(yard(), mesh_of, cache=None)
    caster = RayCaster(1)
    maker = PictureMaker(caster)
    pictures = {}
    for shot in shots:
        frame = store.frame(shot.placements)
        camera = Camera(width, height, shot.fov_deg, shot.eye, shot.rotation_deg, 0)
        hits = caster.cast(
            frame.scene, np.asarray(shot.eye), pixel_rays(camera), low=0.1, high=1000.0
        )
        picture = Picture(
            width, height, shot.fov_deg, rotation_matrix(shot.rotation_deg), hits, -1, 0.1, 1000.0
        )
        pictures[shot.name] = maker.paint(frame, picture, maker.sky.lighting(shot.weather, 0.0))
    caster.close()
    return pictures


def around(target: Vector, away: float, turn_deg: float, height: float) -> tuple[Vector, Vector]:
    """An eye that looks at a place, and its rotation."""
    turn = math.radians(turn_deg)
    eye = (target[0] + away * math.cos(turn), target[1] + away * math.sin(turn), height)
    down = math.degrees(math.atan2(target[2] - height, away))
    return eye, (down, turn_deg + 180.0, 0.0)
