"""What walkers run into beside the town's walls: props, and each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.actors import Actor, ActorTable
from carstage_sim.world.columns import Rotation
from carstage_sim.world.state import ActorKind

FloatArray = NDArray[np.float64]


class Bystanders:
    """Props and walkers as they stand in a tick, from above; props are boxes, walkers are round.

    Args:
        table: the actors.
        walkers: all of them.
    """

    def __init__(self, table: ActorTable, walkers: Sequence[Actor]) -> None:
        props = [
            actor
            for actor in table.of_kind(ActorKind.OTHER)
            if actor.collides and actor.type_id.startswith("static.prop.")
        ]
        rows = table.rows(actor.actor_id for actor in props)
        yaw = np.radians(table.rotation_deg[rows, Rotation.YAW])
        self._axes = np.stack([np.cos(yaw), np.sin(yaw), -np.sin(yaw), np.cos(yaw)], axis=-1)
        self._axes = self._axes.reshape(-1, 2, 2)
        center = np.array([actor.box_center for actor in props]).reshape(-1, 3)
        self._half = np.array([actor.box_extent for actor in props]).reshape(-1, 3)
        self._middle = table.location[rows] + np.concatenate(
            [np.einsum("pi,pij->pj", center[:, :2], self._axes), center[:, 2:]], axis=1
        )
        self._table = table
        others = [walker for walker in walkers if walker.collides]
        self._rows = table.rows(walker.actor_id for walker in others)
        self._reach = np.array([walker.box_extent for walker in others]).reshape(-1, 3)

    def push_out(self, at: NDArray[np.intp], extent: FloatArray) -> None:
        """Move walkers out of what they got into, each after the other.

        Args:
            at: rows of the table.
            extent: ``(len(at), 3)`` their half sizes.
        """
        for row, (radius, _, half_height) in zip(at.tolist(), extent.tolist(), strict=True):
            self._out_of_props(row, radius, half_height)
            self._away_from_walkers(row, radius, half_height)

    def _out_of_props(self, row: int, radius: float, half_height: float) -> None:
        if not len(self._middle):
            return
        place = self._table.location[row]
        offset = place - self._middle
        local = np.einsum("pij,pj->pi", self._axes, offset[:, :2])
        depth = self._half[:, :2] + radius - np.abs(local)
        beside = np.abs(offset[:, 2]) < self._half[:, 2] + half_height
        for prop in np.flatnonzero(beside & (depth > 0.0).all(axis=1)).tolist():
            axis = int(depth[prop].argmin())
            way = np.copysign(depth[prop, axis], local[prop, axis])
            self._table.location[row, :2] += way * self._axes[prop, axis]

    def _away_from_walkers(self, row: int, radius: float, half_height: float) -> None:
        offset = self._table.location[row] - self._table.location[self._rows]
        apart = np.hypot(offset[:, 0], offset[:, 1])
        depth = self._reach[:, 0] + radius - apart
        beside = np.abs(offset[:, 2]) < self._reach[:, 2] + half_height
        # Two at one place have no way apart.
        for other in np.flatnonzero(beside & (depth > 0.0) & (apart > 0.0)).tolist():
            way = offset[other, :2] / apart[other]
            self._table.location[row, :2] += depth[other] * way
