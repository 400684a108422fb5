"""Pedestrians: driven by a direction and a speed, or placed by the client's own navigation.

A walker's origin is at mid height, as the client's navigation assumes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.actors import Actor, ActorTable
from carstage_sim.world.ground import Ground

_MAX_PLAUSIBLE_SPEED = 15.0
_STILL = 1e-3


class WalkerMotion:
    """Moves walkers and derives their velocity from where they were a tick ago.

    Args:
        ground: what they stand on.
    """

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._before: dict[int, NDArray[np.float64]] = {}

    def forget(self, actor_id: int) -> None:
        """A walker was destroyed."""
        self._before.pop(actor_id, None)

    def step(self, table: ActorTable, walkers: Sequence[Actor], delta_s: float) -> None:
        """One tick: walk on, stand on the ground, measure velocities."""
        if not walkers:
            return
        rows = table.rows(walker.actor_id for walker in walkers)
        own = [index for index, walker in enumerate(walkers) if walker.simulate_physics]
        if own:
            self._walk(table, [walkers[index] for index in own], rows[own], delta_s)
        for walker, row in zip(walkers, rows, strict=True):
            here = table.location[row].copy()
            velocity = (here - self._before.get(walker.actor_id, here)) / delta_s
            if float(np.linalg.norm(velocity)) > _MAX_PLAUSIBLE_SPEED:
                velocity = np.zeros(3)  # placed elsewhere, not walked there
            table.acceleration[row] = (velocity - table.velocity[row]) / delta_s
            table.velocity[row] = velocity
            self._before[walker.actor_id] = here

    def _walk(
        self, table: ActorTable, walkers: list[Actor], rows: NDArray[np.intp], delta_s: float
    ) -> None:
        """Walkers that no navigation places: along their direction, feet on the ground."""
        direction = np.array([walker.walker.direction for walker in walkers], np.float64)
        speed = np.array([walker.walker.speed for walker in walkers], np.float64)
        length = np.linalg.norm(direction, axis=1)
        moving = (length > _STILL) & (speed > _STILL)
        unit = direction / np.where(moving, length, 1.0)[:, None]
        table.location[rows] += np.where(moving, speed, 0.0)[:, None] * unit * delta_s
        flat = moving & (np.hypot(unit[:, 0], unit[:, 1]) > _STILL)
        yaw = np.degrees(np.arctan2(unit[:, 1], unit[:, 0]))
        table.rotation_deg[rows, 1] = np.where(flat, yaw, table.rotation_deg[rows, 1])
        half_height = np.array([walker.box_extent[2] for walker in walkers])
        falls = np.array([walker.gravity for walker in walkers], np.bool_)
        standing = self._ground.height(table.location[rows]) + half_height
        lands = falls & np.isfinite(standing)
        table.location[rows, 2] = np.where(lands, standing, table.location[rows, 2])
