"""Small towns, states and requests for sensor tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.town import LaneSamples, Town
from carstage_sim.mesh import Material, TriangleMesh, build_mesh, merge_meshes
from carstage_sim.sensors.measurements import SensorRequest
from carstage_sim.world.state import ActorKind, Weather, WorldState

Placed = tuple[int, tuple[float, float, float], float]
"""Actor id, location in metres, yaw in degrees."""

_QUADS = np.array(
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
)


def box(low: Any, high: Any, material: Material, tag: int, object_id: int = 0) -> TriangleMesh:
    """An upright box between two corners."""
    ends = np.array([low, high], float)
    corner = np.array([[ends[(k >> a) & 1, a] for a in range(3)] for k in range(8)])
    triangles = np.concatenate([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])
    return build_mesh(corner, triangles, material, tag, object_id=object_id)


def town(*meshes: TriangleMesh, geo_reference: tuple[float, float] = (0.0, 0.0)) -> Town:
    """A town of nothing but meshes."""
    none = np.empty(0)
    lanes = LaneSamples(
        *(np.empty((0, 3)), np.empty((0, 3)), none, none, none, none, none, none, none, none)
    )
    return Town(
        name="Test", opendrive="", geo_reference=geo_reference, spawn_points=np.empty((0, 6)),
        lanes=lanes, traffic_lights=(), navigation=b"", static_mesh=merge_meshes(list(meshes)),
        level_objects=(), digest="",
    )  # fmt: skip


GROUND = box((-200, -200, -1), (200, 200, 0), Material.ASPHALT, CityObjectLabel.ROADS)
WALL = box((10, -100, 0), (11, 100, 60), Material.BRICK, CityObjectLabel.BUILDINGS, object_id=5)


def state(
    frame: int = 1,
    *,
    vehicles: list[Placed] | None = None,
    walkers: list[Placed] | None = None,
    delta_s: float = 0.1,
    angular_velocity_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    weather: Weather | None = None,
    sensors: list[Placed] | None = None,
    steer_deg: float = 0.0,
    rolled_m: float = 0.0,
) -> WorldState:
    """A frame with vehicles and walkers of equal velocities, wheels and ways.

    Near sensors of the frame wheels are instances of their own.
    """
    cars = [(*row, ActorKind.VEHICLE, "vehicle.tesla.model3") for row in vehicles or []]
    people = [(*row, ActorKind.WALKER, "walker.pedestrian.0001") for row in walkers or []]
    looking = [(*row, ActorKind.SENSOR, "sensor.camera.rgb") for row in sensors or []]
    rows = sorted(cars + people + looking)
    count = len(rows)
    zeros = np.zeros((count, 3))
    return WorldState(
        frame=frame,
        timestamp_s=frame * delta_s,
        delta_s=delta_s,
        weather=weather or Weather(),
        actor_id=np.array([r[0] for r in rows], np.uint32),
        kind=np.array([r[3] for r in rows], np.uint8),
        type_id=tuple(r[4] for r in rows),
        location=np.array([r[1] for r in rows], float).reshape(count, 3),
        rotation_deg=np.array([(0.0, r[2], 0.0) for r in rows], float).reshape(count, 3),
        velocity=np.tile(np.array(velocity, float), (count, 1)),
        angular_velocity_deg=np.tile(np.array(angular_velocity_deg, float), (count, 1)),
        acceleration=zeros,
        light_state=np.zeros(count, np.uint32),
        control=np.zeros((count, 3), np.float32),
        colour=np.full((count, 3), 120, np.uint8),
        wheel_angle_deg=np.full(count, steer_deg, np.float32),
        rolled_m=np.full(count, rolled_m),
    )


def request(
    kind: str,
    sensor_id: int = 100,
    *,
    location: tuple[float, float, float] = (0.0, 0.0, 2.0),
    rotation_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    owner_id: int = 0,
    **attributes: object,
) -> SensorRequest:
    """A listening sensor; attributes are written as a client would."""
    text = {name: str(value) for name, value in attributes.items()}
    if kind.startswith("camera"):
        text = {"image_size_x": "64", "image_size_y": "48", "fov": "90"} | text
    return SensorRequest(sensor_id, f"sensor.{kind}", text, location, rotation_deg, owner_id)
