"""The frozen state of one frame: what the snapshot message and every sensor are made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.posing import Pose as Joints
from carstage_sim.world.debug_shapes import DebugShapes
from carstage_sim.world.town_changes import TownChanges
from carstage_sim.world.transmissions import Transmission


class ActorKind(IntEnum):
    """What kind of actor a row of :class:`WorldState` is; it decides the row's extra fields."""

    OTHER = 0
    VEHICLE = 1
    WALKER = 2
    TRAFFIC_LIGHT = 3
    TRAFFIC_SIGN = 4
    SENSOR = 5


@dataclass(frozen=True, slots=True)
class Weather:
    """CARLA's weather parameters, in the order of ``carla.WeatherParameters`` (0.9.14 and later).

    Percentages are 0-100, angles degrees, distances metres.
    """

    cloudiness: float = 0.0
    precipitation: float = 0.0
    precipitation_deposits: float = 0.0
    wind_intensity: float = 0.0
    sun_azimuth_angle: float = 0.0
    sun_altitude_angle: float = 45.0
    fog_density: float = 0.0
    fog_distance: float = 0.0
    fog_falloff: float = 0.2
    wetness: float = 0.0
    scattering_intensity: float = 1.0
    mie_scattering_scale: float = 0.03
    rayleigh_scattering_scale: float = 0.0331
    dust_storm: float = 0.0


@dataclass(frozen=True, slots=True)
class Collision:
    """Two bodies that touched in a tick.

    Attributes:
        first_id: an actor.
        second_id: another actor, 0 for the town.
        impulse: N s in the world that the second one got; the first one got the opposite. Zero for
            bodies that only rest against each other.
        label: what of the town was touched, a :class:`carstage_sim.labels.CityObjectLabel`; 0 where
            the second one is an actor.
    """

    first_id: int
    second_id: int
    impulse: tuple[float, float, float]
    label: int = 0


@dataclass(frozen=True, slots=True)
class WorldState:
    """All live actors of one frame, one row each, ascending actor id.

    Attributes:
        frame: frame number, > 0 and strictly increasing.
        timestamp_s: simulated seconds since the episode began.
        delta_s: simulated seconds of this step.
        weather: the weather of this frame.
        actor_id: ``(N,)`` uint32.
        kind: ``(N,)`` uint8, values of :class:`ActorKind`.
        type_id: N blueprint ids such as ``vehicle.tesla.model3``.
        location: ``(N, 3)`` float64 world metres.
        rotation_deg: ``(N, 3)`` float64 pitch, yaw, roll.
        velocity: ``(N, 3)`` float64 m/s, world.
        angular_velocity_deg: ``(N, 3)`` float64 deg/s, world.
        acceleration: ``(N, 3)`` float64 m/s^2, world.
        light_state: ``(N,)`` uint32: vehicles: ``carla.VehicleLightState`` bits, with the brake
            bit as set by clients; traffic lights: ``carla.TrafficLightState``; else 0.
        control: ``(N, 3)`` float32: throttle, steer, brake of vehicles; speed of walkers in
            column 0.
        colour: ``(N, 3)`` uint8 paint colour (blueprint attribute ``color``), 0 for none.
        wheel_angle_deg: ``(N,)`` float32 front wheel steering angle of vehicles.
        rolled_m: ``(N,)`` float64 way of vehicles along their heading since they were spawned.
        collisions: what touched in this step; walkers only while a sensor of collisions lives.
        doors: ``(N,)`` uint8 open doors of vehicles, a bit ``1 << carla.VehicleDoor`` for each;
            None for all closed.
        town_changes: what clients changed about the town, None for nothing and all lamps off.
        debug_shapes: what clients drew, None for nothing.
        figures: joints of the walkers that clients pose, by actor id.
        wheelchairs: ids of the walkers in wheelchairs.
        hero_id: the first actor with the role of a hero, 0 for none.
        transmissions: what V2X sensors send in this frame, by ascending sensor ids.
    """

    frame: int
    timestamp_s: float
    delta_s: float
    weather: Weather
    actor_id: NDArray[np.uint32]
    kind: NDArray[np.uint8]
    type_id: tuple[str, ...]
    location: NDArray[np.float64]
    rotation_deg: NDArray[np.float64]
    velocity: NDArray[np.float64]
    angular_velocity_deg: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    light_state: NDArray[np.uint32]
    control: NDArray[np.float32]
    colour: NDArray[np.uint8]
    wheel_angle_deg: NDArray[np.float32]
    rolled_m: NDArray[np.float64]
    collisions: tuple[Collision, ...] = ()
    doors: NDArray[np.uint8] | None = None
    town_changes: TownChanges | None = None
    debug_shapes: DebugShapes | None = None
    figures: Mapping[int, Joints] = field(default_factory=dict)
    wheelchairs: frozenset[int] = frozenset()
    hero_id: int = 0
    transmissions: tuple[Transmission, ...] = ()
