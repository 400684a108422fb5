"""The reference scene: a town with a hundred actors that move, and a camera in the street."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

import carla
import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.traffic.towns import carla_maps
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps import MapCatalogue, Town
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.picture import PictureMaker
from carstage_sim.render.scene import SceneStore
from carstage_sim.sensors import WorldSensors
from carstage_sim.sensors.measurements import ImageFrame, SensorFrame, SensorRequest
from carstage_sim.sensors.view import View
from carstage_sim.world.errors import SpawnError
from carstage_sim.world.pose import Pose, Vector3
from carstage_sim.world.state import Weather, WorldState
from carstage_sim.world.world import World

_PARAMETERS = (
    "cloudiness", "precipitation", "precipitation_deposits", "wind_intensity", "sun_azimuth_angle",
    "sun_altitude_angle", "fog_density", "fog_distance", "fog_falloff", "wetness",
    "scattering_intensity", "mie_scattering_scale", "rayleigh_scattering_scale", "dust_storm",
)  # fmt: skip
_VEHICLES = (
    "vehicle.tesla.model3", "vehicle.audi.tt", "vehicle.nissan.patrol", "vehicle.mini.cooper_s",
    "vehicle.mercedes.sprinter", "vehicle.ford.mustang", "vehicle.volkswagen.t2",
    "vehicle.lincoln.mkz_2017", "vehicle.carlamotors.carlacola", "vehicle.kawasaki.ninja",
    "vehicle.bh.crossbike",
)  # fmt: skip
_PAINTS = ("180,20,20", "20,40,120", "220,220,220", "30,30,30", "120,120,125", "200,180,40")
_BESIDE_M = 5.5
_CAMERA_M = 1.6
_DELTA_S = 0.05
_SETTLING_TICKS = 10

NO_ACTORS: Callable[[str], TriangleMesh] = dict[str, TriangleMesh]().__getitem__
"""Gives the meshes of a scene without actors."""


def named_presets() -> dict[str, Weather]:
    """The weathers that the client has names for, without ``Default``, which sets nothing."""
    found = {}
    for name in sorted(dir(carla.WeatherParameters)):
        preset = getattr(carla.WeatherParameters, name)
        if isinstance(preset, carla.WeatherParameters) and name != "Default":
            found[name] = Weather(*(float(getattr(preset, field)) for field in _PARAMETERS))
    return found


def town_of(name: str) -> Town:
    """A built-in town, or one of CARLA's where its file is installed."""
    with carla_maps(None) as folder:
        return MapCatalogue(() if folder is None else (folder,)).load(name)


@dataclass(slots=True)
class ReferenceScene:
    """A populated world and a place to look from.

    Attributes:
        world: with its actors.
        location, rotation_deg: of the camera.
        sensors: the sensors.
    """

    world: World
    location: tuple[float, float, float]
    rotation_deg: tuple[float, float, float]
    sensors: WorldSensors

    def state(self, weather: Weather | None = None) -> WorldState:
        """The next tick's state."""
        if weather is not None:
            self.world.set_weather(weather)
        return self.world.tick(_DELTA_S).state

    def request(self, kind: str, number: int = 0, **attributes: object) -> SensorRequest:
        """A listening sensor at the camera's place."""
        text = {name: str(value) for name, value in attributes.items()}
        return SensorRequest(
            900_000 + number, f"sensor.{kind}", text, self.location, self.rotation_deg, 0
        )

    def frame(self, state: WorldState, kind: str, **attributes: object) -> SensorFrame:
        """What a new sensor sees."""
        self.sensors.reset()
        ((_, frame),) = self.sensors.capture(state, [self.request(kind, 0, **attributes)])
        return frame

    def picture(self, weather: Weather, width: int, height: int) -> NDArray[np.uint8]:
        """``(H, W, 3)`` sRGB picture in a weather."""
        return rgb(
            self.frame(self.state(weather), "camera.rgb", image_size_x=width, image_size_y=height)
        )


def rgb(frame: SensorFrame) -> NDArray[np.uint8]:
    """``(H, W, 3)`` of a camera's picture."""
    assert isinstance(frame, ImageFrame)
    colours: NDArray[np.uint8] = frame.pixels[..., 2::-1].copy()
    return colours


def populate(
    town: Town, sensors: WorldSensors, *, vehicles: int, walkers: int, seed: int
) -> ReferenceScene:
    """Actors at spawn points, walkers beside the lanes, all on the move.

    Raises:
        RuntimeError: the map has no room for so many.
    """
    chance = random.Random(seed)
    places = [tuple(place) for place in town.spawn_points.tolist()]
    chance.shuffle(places)
    first = _overlook(np.array(places), vehicles)
    x, y, z, _, yaw, _ = places.pop(first)
    world = World(town, 1)
    spawned = 0
    for px, py, pz, pitch, turn, roll in places:
        if spawned == vehicles:
            break
        try:
            actor = world.spawn(
                _VEHICLES[spawned % len(_VEHICLES)],
                {"color": _PAINTS[spawned % len(_PAINTS)]},
                Pose((px, py, pz), (pitch, turn, roll)),
            )
        except SpawnError:
            continue
        world.set_constant_velocity(actor.actor_id, (4.0, 0.0, 0.0))
        spawned += 1
    walking = 0
    for k in range(walkers * 20):
        if walking == walkers:
            break
        px, py, pz, _, turn, _ = places[k % len(places)]
        side, along = _BESIDE_M + chance.random(), 6.0 * chance.random()
        c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        place = (px + along * c - side * s, py + along * s + side * c, pz + 0.7)
        pose = Pose(place, (0.0, 360.0 * chance.random(), 0.0))
        try:
            world.spawn(f"walker.pedestrian.{1 + walking % 40:04d}", {}, pose)
        except SpawnError:
            continue
        walking += 1
    # Spawn points hang above the road: vehicles fall for less than half a second.
    for _ in range(_SETTLING_TICKS):
        world.tick(_DELTA_S)
    if (spawned, walking) != (vehicles, walkers):
        raise RuntimeError(f"{town.name} has room for {spawned} vehicles and {walking} walkers")
    return ReferenceScene(world, (x, y, z + _CAMERA_M), (-4.0, yaw, 0.0), sensors)


def _overlook(places: NDArray[np.float64], vehicles: int) -> int:
    """The spawn point that looks on most of those which will be taken."""
    c, s = np.cos(np.radians(places[:, 4])), np.sin(np.radians(places[:, 4]))
    offset = places[None, :vehicles, :2] - places[:, None, :2]
    ahead = offset[..., 0] * c[:, None] + offset[..., 1] * s[:, None]
    aside = np.abs(offset[..., 1] * c[:, None] - offset[..., 0] * s[:, None])
    seen = (ahead > 6.0) & (ahead < 70.0) & (aside < 0.4 * ahead)
    return int((seen / np.maximum(ahead, 6.0)).sum(axis=1).argmax())


def plain_view(caster: RayCaster, weather: Weather, *, pole_m: float = 0.0) -> View:
    """An endless-looking plain, with a thin pole of some height in its middle."""
    ground = _box((-9.0, -9.0, -1.0), (9.0, 9.0, 0.0), Material.CONCRETE)
    pole = _box((-0.04, -0.04, 0.0), (0.04, 0.04, pole_m), Material.CONCRETE)
    store = SceneStore(merge_meshes([ground, pole]), NO_ACTORS, cache=None)
    return View(lambda: store.frame([]), caster, PictureMaker(caster), weather, 0.0)


def _box(low: Vector3, high: Vector3, material: Material) -> TriangleMesh:
    corners = np.array([[(low, high)[(k >> a) & 1][a] for a in range(3)] for k in range(8)])
    quads = np.array(
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    )
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return build_mesh(corners, triangles, material, CityObjectLabel.GROUND)
