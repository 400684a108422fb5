"""Collisions as the vehicles' own sensors report them; boxes that reach walkers and buildings."""

from __future__ import annotations

import numpy as np

from carstage_sim.check.traffic.recording import Partner, Recording
from carstage_sim.world.overlap import overlaps

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

    The walkers' controllers switch their collisions off, so no sensor tells of them. Heights are
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
    looks = recording.every(_LOOK_EVERY_S)
    found = []
    middle = recording.location[looks] + np.array([0.0, 0.0, 1.0])
    for center, extent, yaw_deg in zip(
        recording.building_center,
        recording.building_extent,
        recording.building_yaw_deg.tolist(),
        strict=True,
    ):
        reach = np.linalg.norm(extent[:2]) + 8.0
        for step, row in np.argwhere(
            np.linalg.norm(middle[..., :2] - center[:2], axis=-1) < reach
        ).tolist():
            box = recording.box_extent[row] * np.array([1.0, 1.0, 0.1])
            if overlaps(
                middle[step, row],
                box,
                float(recording.yaw_deg[looks][step, row]),
                center[None],
                extent[None],
                np.array([yaw_deg]),
            )[0]:
                found.append((step * looks.step, row))
    first: dict[int, int] = {}
    for tick, row in sorted(found):
        first.setdefault(row, tick)
    return sorted((tick, row) for row, tick in first.items())
