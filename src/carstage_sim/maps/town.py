"""What a map is to the rest of the simulator: one frozen record of arrays.

A town is baked once (OpenDRIVE text in, arrays out) and cached by content; nothing here parses.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from carstage_sim.mesh import TriangleMesh


@dataclass(frozen=True, slots=True)
class LaneSamples:
    """Centre-line samples of every driving lane, about one metre apart.

    Attributes:
        location: ``(N, 3)`` float64 world metres.
        rotation_deg: ``(N, 3)`` float64 pitch, yaw, roll along the direction of travel.
        width_m: ``(N,)`` float32.
        speed_limit_kmh: ``(N,)`` float32, of a vehicle that appears here.
        posted_kmh: ``(N,)`` float32, what a sign says that is passed here; 0 for none.
        road_id, section_id, lane_id: ``(N,)`` int32, OpenDRIVE's.
        s_m: ``(N,)`` float64 along the road's reference line.
        junction_id: ``(N,)`` int32, -1 outside junctions.
    """

    location: NDArray[np.float64]
    rotation_deg: NDArray[np.float64]
    width_m: NDArray[np.float32]
    speed_limit_kmh: NDArray[np.float32]
    posted_kmh: NDArray[np.float32]
    road_id: NDArray[np.int32]
    section_id: NDArray[np.int32]
    lane_id: NDArray[np.int32]
    s_m: NDArray[np.float64]
    junction_id: NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class OrientedBox:
    """A box in the world: centre (m), half extents (m), rotation (pitch, yaw, roll in degrees)."""

    center: tuple[float, float, float]
    extent: tuple[float, float, float]
    rotation_deg: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class TrafficLightSite:
    """One traffic light of the map.

    Attributes:
        sign_id: the OpenDRIVE signal's id; clients match landmarks and actors by it.
        location, rotation_deg: pose of the light actor's pivot (foot of the pole).
        head: pose of the light head relative to the pivot: x, y, z, yaw_deg. The lenses look
            against the traffic that they govern.
        junction_id: OpenDRIVE junction that it belongs to.
        phase: lights of one junction with equal phase are green together.
        trigger: the volumes before the stop line, on each lane it governs; a vehicle whose centre
            is inside is "at" this light.
    """

    sign_id: str
    location: tuple[float, float, float]
    rotation_deg: tuple[float, float, float]
    head: tuple[float, float, float, float]
    junction_id: int
    phase: int
    trigger: tuple[OrientedBox, ...]


@dataclass(frozen=True, slots=True)
class TrafficSignSite:
    """A sign that clients see as an actor; its post and plate are scenery.

    Attributes:
        sign_id: the OpenDRIVE signal's id.
        type_id: ``traffic.stop`` or ``traffic.yield``.
        location, rotation_deg: pose of the actor.
        trigger: the volumes where it holds, on each lane.
    """

    sign_id: str
    type_id: str
    location: tuple[float, float, float]
    rotation_deg: tuple[float, float, float]
    trigger: tuple[OrientedBox, ...]


class MapLayer(IntFlag):
    """``carla.MapLayer``: parts of a map that clients can take away and bring back."""

    NONE = 0x0
    BUILDINGS = 0x1
    DECALS = 0x2
    FOLIAGE = 0x4
    GROUND = 0x8
    PARKED_VEHICLES = 0x10
    PARTICLES = 0x20
    PROPS = 0x40
    STREET_LIGHTS = 0x80
    WALLS = 0x100
    ALL = 0xFFFF


@dataclass(frozen=True, slots=True)
class LevelObject:
    """A piece of static scenery that clients can ask for (building, tree, pole, sign …).

    Attributes:
        layer: value of :class:`MapLayer` that it goes away with; ``NONE`` if it always stays.
    """

    object_id: int
    name: str
    label: int
    box: OrientedBox
    layer: int = MapLayer.NONE


@dataclass(frozen=True, slots=True)
class Town:
    """A baked map.

    Attributes:
        name: short name, ``Stage01``; clients see ``Carla/Maps/Stage01``.
        opendrive: the OpenDRIVE 1.4 text that clients get.
        geo_reference: latitude and longitude of the origin in degrees.
        spawn_points: ``(N, 6)`` float64: x, y, z (m), pitch, yaw, roll (deg), on driving lanes
            outside junctions, at least 8 m apart.
        lanes: samples of the driving lanes.
        traffic_lights: every light, grouped by junction and phase.
        navigation: Recast/Detour ``MSET`` file of the walkable surface, as the client loads it.
        static_mesh: roads, markings, sidewalks, buildings, trees, street furniture.
        level_objects: the objects that ``static_mesh.object_id - 1`` points into.
        digest: sha256 (hex) of what was baked; caches and the client's file names carry it.
        traffic_signs: signs that are actors, by id.
    """

    name: str
    opendrive: str
    geo_reference: tuple[float, float]
    spawn_points: NDArray[np.float64]
    lanes: LaneSamples
    traffic_lights: tuple[TrafficLightSite, ...]
    navigation: bytes
    static_mesh: TriangleMesh
    level_objects: tuple[LevelObject, ...]
    digest: str
    traffic_signs: tuple[TrafficSignSite, ...] = ()

    @property
    def entrance(self) -> tuple[float, float, float]:
        """The first spawn point, m, or where all lanes are too short for one, a place on a lane."""
        places = self.spawn_points if len(self.spawn_points) else self.lanes.location
        x, y, z = places[0, :3].tolist()
        return x, y, z
