"""Actors that ride on others: their poses follow the parent's, parents before children."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import FloatArray, pose_matrix, rotation_deg
from carstage_sim.world.actors import Actor, ActorTable


class Attachments:
    """Which rows follow which, for one set of live actors.

    Args:
        table: the live actors; rebuild after every spawn or destroy.
    """

    def __init__(self, table: ActorTable) -> None:
        levels: dict[int, list[Actor]] = {}
        for actor in table:
            if actor.parent_id in table:
                levels.setdefault(_depth(table, actor), []).append(actor)
        self._levels: list[tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]] = [
            (
                table.rows(actor.actor_id for actor in actors),
                table.rows(actor.parent_id for actor in actors),
                pose_matrix(
                    [actor.relative.location for actor in actors],
                    [actor.relative.rotation_deg for actor in actors],
                ),
            )
            for _, actors in sorted(levels.items())
        ]

    def follow(self, table: ActorTable) -> None:
        """Move every attached actor to where its parent carries it.

        Velocity and acceleration are those of the point of attachment without the parent's
        rotation; the angular velocity is the parent's.
        """
        for rows, parents, parent_from_child in self._levels:
            world_from_parent = pose_matrix(table.location[parents], table.rotation_deg[parents])
            world_from_child = world_from_parent @ parent_from_child
            table.location[rows] = world_from_child[:, :3, 3]
            table.rotation_deg[rows] = rotation_deg(world_from_child[:, :3, :3])
            table.velocity[rows] = table.velocity[parents]
            table.angular_velocity_deg[rows] = table.angular_velocity_deg[parents]
            table.acceleration[rows] = table.acceleration[parents]


def _depth(table: ActorTable, actor: Actor) -> int:
    depth = 0
    parent = table.get(actor.parent_id)
    while parent is not None:
        depth += 1
        parent = table.get(parent.parent_id)
    return depth
