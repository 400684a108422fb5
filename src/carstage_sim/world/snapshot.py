"""One frame as it leaves the world: the shared state and the columns of each kind of actor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.state import WorldState


@dataclass(frozen=True, slots=True)
class VehicleColumns:
    """What a snapshot says of vehicles apart from their motion; V rows.

    Attributes:
        rows: ``(V,)`` rows in the state.
        control: ``(V, 3)`` float32 throttle, steer, brake.
        hand_brake, reverse, manual_gear_shift: ``(V,)`` bool.
        gear: ``(V,)`` int32.
        speed_limit_kmh: ``(V,)`` float32 of the last sign that was passed.
        light_id: ``(V,)`` uint32 traffic light whose trigger holds the vehicle, 0 for none.
        light_state: ``(V,)`` uint8 of that light; green where there is none.
    """

    rows: NDArray[np.intp]
    control: NDArray[np.float32]
    hand_brake: NDArray[np.bool_]
    reverse: NDArray[np.bool_]
    manual_gear_shift: NDArray[np.bool_]
    gear: NDArray[np.int32]
    speed_limit_kmh: NDArray[np.float32]
    light_id: NDArray[np.uint32]
    light_state: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class WalkerColumns:
    """What a snapshot says of walkers apart from their motion; W rows.

    Attributes:
        rows: ``(W,)`` rows in the state.
        direction: ``(W, 3)`` float32.
        speed: ``(W,)`` float32 m/s.
        jump: ``(W,)`` bool.
    """

    rows: NDArray[np.intp]
    direction: NDArray[np.float32]
    speed: NDArray[np.float32]
    jump: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class TrafficLightColumns:
    """What a snapshot says of traffic lights; L rows.

    Attributes:
        rows: ``(L,)`` rows in the state.
        sign_id: OpenDRIVE signal ids.
        green_s, yellow_s, red_s, elapsed_s: ``(L,)`` float32.
        pole_index: ``(L,)`` uint32 place within the light's group.
        frozen: ``(L,)`` bool.
        state: ``(L,)`` uint8 of ``carla.TrafficLightState``.
    """

    rows: NDArray[np.intp]
    sign_id: tuple[str, ...]
    green_s: NDArray[np.float32]
    yellow_s: NDArray[np.float32]
    red_s: NDArray[np.float32]
    elapsed_s: NDArray[np.float32]
    pole_index: NDArray[np.uint32]
    frozen: NDArray[np.bool_]
    state: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class TrafficSignColumns:
    """What a snapshot says of traffic signs: their ``rows`` and OpenDRIVE ids."""

    rows: NDArray[np.intp]
    sign_id: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A frame: what the world-observer message is encoded from.

    Attributes:
        episode_id: differs between episodes of one server.
        map_changed: the first frame of an episode, which makes clients fetch the map again.
        lights_changed: whether street lights were switched since the frame before.
    """

    episode_id: int
    map_changed: bool
    state: WorldState
    vehicles: VehicleColumns
    walkers: WalkerColumns
    traffic_lights: TrafficLightColumns
    traffic_signs: TrafficSignColumns | None = None
    lights_changed: bool = False
