"""Collisions as the vehicles' own sensors report them; boxes that reach walkers and buildings."""

from __future__ import annotations

from collections.abc import Iterable

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
    """Pairs that touched: the first tick and the two actor ids.

    Both vehicles of a pair report, and so does every tick in which they touch: all that counts once
    in five seconds from the first touch.
    """
    rows = np.flatnonzero(recording.collision_kind == kind)
    return _once_in_a_window(
        (
            (tick, min(one, other), max(one, other))
            for tick, one, other in zip(
                recording.collision_tick[rows].tolist(),
                recording.collision_vehicle[rows].tolist(),
                recording.collision_other[rows].tolist(),
                strict=True,
            )
        ),
        recording,
    )


def walkers_hit(recording: Recording) -> list[tuple[int, int, int]]:
    """Walkers that a moving vehicle's box reached: the first tick, and both rows.

    The walkers' controllers switch their collisions off, so no sensor reports them. Heights are
    compared too: a walker may cross below a bridge.
    """
    touches: list[tuple[int, int, int]] = []
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
        touches += [(tick, vehicle, walker) for tick, vehicle in np.argwhere(reached).tolist()]
    return _once_in_a_window(touches, recording)


def _once_in_a_window(
    touches: Iterable[tuple[int, int, int]], recording: Recording
) -> list[tuple[int, int, int]]:
    """Of touches of pairs, each a tick and two numbers, those that begin a window of a pair."""
    window = round(WINDOW_S / recording.delta_s)
    begun: dict[tuple[int, int], int] = {}
    found = []
    for tick, one, other in sorted(touches):
        if tick - begun.get((one, other), -window) >= window:
            begun[one, other] = tick
            found.append((tick, one, other))
    return found


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
