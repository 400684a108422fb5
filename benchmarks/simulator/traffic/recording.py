"""What a traffic trial saw, tick by tick, as arrays: every figure is computed from this alone.

Axes: ``T`` ticks, ``N`` vehicles, ``W`` walkers, ``L`` traffic lights, ``K`` stop lines, ``S``
samples of lanes, ``C`` reports of collision sensors. World axes and metres as in CARLA.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating]

NO_LIGHT = 255
"""``light_state`` of a vehicle that is at no light."""

RED, YELLOW, GREEN = 0, 1, 2
"""``carla.TrafficLightState``."""


class Partner(IntEnum):
    """What a vehicle collided with."""

    VEHICLE = 0
    WALKER = 1
    SCENERY = 2


@dataclass(frozen=True, slots=True)
class Recording:
    """One trial.

    Attributes:
        town: the map's name.
        delta_s: simulated seconds of a tick.
        vehicle_id: ``(N,)`` actor ids.
        vehicle_type: ``(N,)`` blueprint ids.
        box_center, box_extent: ``(N, 3)`` bounding boxes in the vehicles' frames.
        location: ``(T, N, 3)``; rows of vehicles that are gone are NaN, here and below.
        yaw_deg, speed, speed_limit_kmh: ``(T, N)``; the speed in m/s.
        light_state: ``(T, N)`` state of the light that a vehicle is at, or :data:`NO_LIGHT`.
        walker_location: ``(T, W, 3)``.
        signal_id: ``(L,)`` actor ids of the lights.
        signal_state: ``(T, L)``.
        stop_signal: ``(K,)`` row of the light that a stop line belongs to.
        stop_pose: ``(K, 4)`` x, y, z and yaw (deg) of the lane there.
        stop_width_m: ``(K,)`` width of that lane.
        lane_tick: ``(S,)`` ticks at which lanes were looked up.
        lane_offset_m: ``(S, N)`` distance from the middle of the nearest driving lane.
        lane_half_width_m: ``(S, N)`` of that lane.
        in_junction: ``(S, N)`` whether that lane is inside a junction.
        collision_tick, collision_vehicle, collision_other, collision_kind: ``(C,)`` the tick, the
            two actor ids, and a :class:`Partner`.
        building_center, building_extent: ``(B, 3)`` boxes of the buildings.
        building_yaw_deg: ``(B,)``.
        free_flow, free_flow_with_lights: mean speeds (m/s) of vehicles that do not meet others, see
            ``lone_vehicles_trial``; NaN for unknown.
        ticks_per_s: of wall time.
        wake_ups: lost notifications of the Traffic Manager that were made up for.
    """

    town: str
    delta_s: float
    vehicle_id: NDArray[np.int64]
    vehicle_type: NDArray[np.str_]
    box_center: FloatArray
    box_extent: FloatArray
    location: FloatArray
    yaw_deg: FloatArray
    speed: FloatArray
    speed_limit_kmh: FloatArray
    light_state: NDArray[np.uint8]
    walker_location: FloatArray
    signal_id: NDArray[np.int64]
    signal_state: NDArray[np.uint8]
    stop_signal: NDArray[np.int64]
    stop_pose: FloatArray
    stop_width_m: FloatArray
    lane_tick: NDArray[np.int64]
    lane_offset_m: FloatArray
    lane_half_width_m: FloatArray
    in_junction: NDArray[np.bool_]
    collision_tick: NDArray[np.int64]
    collision_vehicle: NDArray[np.int64]
    collision_other: NDArray[np.int64]
    collision_kind: NDArray[np.uint8]
    building_center: FloatArray
    building_extent: FloatArray
    building_yaw_deg: FloatArray
    ticks_per_s: float
    wake_ups: int
    free_flow: float = float("nan")
    free_flow_with_lights: float = float("nan")

    @property
    def seconds(self) -> float:
        """Simulated seconds."""
        return len(self.location) * self.delta_s

    @property
    def present(self) -> NDArray[np.bool_]:
        """``(T, N)`` whether a vehicle was there."""
        return ~np.isnan(self.speed)

    @property
    def vehicle_minutes(self) -> float:
        """Simulated minutes summed over the vehicles that were there."""
        return float(self.present.sum() * self.delta_s / 60.0)

    def every(self, seconds: float) -> slice:
        """The ticks at which a quantity is looked at that often."""
        return slice(0, None, max(round(seconds / self.delta_s), 1))

    def save(self, path: Path) -> None:
        """Write it as an ``.npz``, to look at what went wrong without driving again."""
        columns = {field.name: np.asarray(getattr(self, field.name)) for field in fields(self)}
        np.savez_compressed(path, allow_pickle=False, **columns)

    @classmethod
    def load(cls, path: Path) -> Recording:
        """Read what :meth:`save` wrote."""
        with np.load(path) as columns:
            values = {field.name: columns[field.name] for field in fields(cls)}
        return cls(**{name: v.item() if v.ndim == 0 else v for name, v in values.items()})
