"""Collisions as the vehicles' own sensors report them; boxes that reach walkers and buildings."""

from __future__ import annotations

import numpy as np

from benchmarks.simulator.traffic.recording import Partner, Recording
from carstage_sim.maps.town import OrientedBox
from carstage_sim.world.signals.trigger_boxes import TriggerBoxes

WINDOW_S = 5.0
HIT_SPEED = 0.5  # m/s; a walker may well walk into a car that stands
_WALKER_M = 0.2
_SAME_LEVEL_M = 3.0
_LOOK_EVERY_S = 0.5


def collision_pairs(recording: Recording, kind: Partner) -> list[tuple[int, int, int]]:
    """Distinct pairs of each five seconds: the first tick and the two actor ids.

    Both vehicles of a pair report, and so does every tick in which they touch: all that counts once
    in each window.
    """
    window = round(WINDOW_S / recording.delta_s)
    first: dict[tuple[int, int, int], int] = {}
    rows = np.flatnonzero(recording.collision_kind == kind)
    for tick, one, other in zip(
        recording.collision_tick[rows].tolist(),
        recording.collision_vehicle[rows].tolist(),
        recording.collision_other[rows].tolist(),
        strict=True,
    ):
        key = (tick // window, min(one, other), max(one, other))
        first[key] = min(tick, first.get(key, tick))
    return sorted((tick, one, other) for (_, one, other), tick in first.items())


def walkers_hit(recording: Recording) -> list[tuple[int, int, int]]:
    """Walkers that a moving vehicle's box reached: first tick of each five seconds, and both rows.

    The walkers' controllers switch their collisions off, so no sensor reports them. Heights are
    compared too: a walker may cross below a bridge.
    """
    window = round(WINDOW_S / recording.delta_s)
    first: dict[tuple[int, int, int], int] = {}
    yaw = np.radians(recording.yaw_deg)
    for walker in range(recording.walker_location.shape[1]):
        offset = recording.walker_location[:, walker, None] - recording.location
        ahead = offset[..., 0] * np.cos(yaw) + offset[..., 1] * np.sin(yaw)
        aside = offset[..., 1] * np.cos(yaw) - offset[..., 0] * np.sin(yaw)
        reached = (
            (np.abs(ahead - recording.box_center[:, 0]) < recording.box_extent[:, 0] + _WALKER_M)
            & (np.abs(aside - recording.box_center[:, 1]) < recording.box_extent[:, 1] + _WALKER_M)
            & (np.abs(offset[..., 2]) < _SAME_LEVEL_M)
            & (recording.speed > HIT_SPEED)
        )
        for tick, vehicle in np.argwhere(reached).tolist():
            first.setdefault((tick // window, vehicle, walker), tick)
    return sorted((tick, vehicle, walker) for (_, vehicle, walker), tick in first.items())


def inside_buildings(recording: Recording) -> list[tuple[int, int]]:
    """Vehicles whose box was inside a building's, each once: the first tick and its row."""
    rotation = np.stack([np.zeros(len(recording.building_yaw_deg))] * 3, axis=1)
    rotation[:, 1] = recording.building_yaw_deg
    buildings = TriggerBoxes(
        (number, OrientedBox(tuple(center), tuple(extent), tuple(turn)))
        for number, (center, extent, turn) in enumerate(
            zip(
                recording.building_center.tolist(),
                recording.building_extent.tolist(),
                rotation.tolist(),
                strict=True,
            )
        )
    )
    looks = recording.every(_LOOK_EVERY_S)
    first: dict[int, int] = {}
    for step, (location, yaw_deg) in enumerate(
        zip(recording.location[looks], recording.yaw_deg[looks], strict=True)
    ):
        there = np.flatnonzero(~np.isnan(yaw_deg))
        inside = buildings.owners_at(
            location[there].astype(np.float64),
            recording.box_extent[there, :2].astype(np.float64),
            np.radians(yaw_deg[there]),
        )
        for row in there[inside >= 0].tolist():
            first.setdefault(row, step * looks.step)
    return sorted((tick, row) for row, tick in first.items())
