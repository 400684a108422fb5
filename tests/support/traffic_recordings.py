"""Recordings written by hand: a few vehicles on a straight lane along x."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.simulator.traffic.recording import NO_LIGHT, Recording

DELTA_S = 0.5
EXTENT = (2.4, 1.0, 0.75)


def recording(x: Any, *, light_state: Any = None, **columns: Any) -> Recording:
    """Vehicles that are at ``x`` (T, N), heading along it; NaN where one is gone."""
    x = np.asarray(x, np.float64)
    ticks, count = x.shape
    location = np.stack([x, np.where(np.isnan(x), np.nan, 0.0)] * 2, axis=-1)[..., [0, 1, 3]]
    speed = np.abs(np.diff(x, axis=0, prepend=x[:1])) / DELTA_S
    values: dict[str, Any] = {
        "town": "Straight",
        "delta_s": DELTA_S,
        "vehicle_id": np.arange(count) + 10,
        "vehicle_type": np.array(["vehicle.test"] * count),
        "box_center": np.zeros((count, 3)),
        "box_extent": np.tile(EXTENT, (count, 1)),
        "location": location,
        "yaw_deg": np.where(np.isnan(x), np.nan, 0.0),
        "speed": speed,
        "speed_limit_kmh": np.where(np.isnan(x), np.nan, 36.0),
        "light_state": np.full(x.shape, NO_LIGHT, np.uint8)
        if light_state is None
        else np.asarray(light_state, np.uint8),
        "walker_location": np.zeros((ticks, 0, 3)),
        "signal_id": np.zeros(0, np.int64),
        "signal_state": np.zeros((ticks, 0), np.uint8),
        "stop_signal": np.zeros(0, np.int64),
        "stop_pose": np.zeros((0, 4)),
        "stop_width_m": np.zeros(0),
        "lane_tick": np.arange(ticks),
        "lane_offset_m": np.zeros((ticks, count)),
        "lane_half_width_m": np.full((ticks, count), 1.75),
        "in_junction": np.zeros((ticks, count), np.bool_),
        "collision_tick": np.zeros(0, np.int64),
        "collision_vehicle": np.zeros(0, np.int64),
        "collision_other": np.zeros(0, np.int64),
        "collision_kind": np.zeros(0, np.uint8),
        "building_center": np.zeros((0, 3)),
        "building_extent": np.zeros((0, 3)),
        "building_yaw_deg": np.zeros(0),
        "ticks_per_s": 100.0,
        "wake_ups": 0,
        "free_flow": 7.0,
        "free_flow_with_lights": 5.0,
    }
    return Recording(**{**values, **columns})


def collisions(*rows: tuple[int, int, int, int]) -> dict[str, Any]:
    """Columns of reports: tick, vehicle, other, kind."""
    table = np.array(rows, np.int64).reshape(-1, 4)
    names = ("collision_tick", "collision_vehicle", "collision_other", "collision_kind")
    return dict(zip(names, table.T, strict=True))
