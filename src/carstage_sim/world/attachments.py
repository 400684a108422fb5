"""Actors that ride on others: their poses follow the parent's, parents before children.

Most are rigid and move as one array. The few that a spring arm or a moving bone carries are moved
one by one.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import FloatArray, pose_matrix, rotation_deg
from carstage_sim.world.actors import Actor, ActorTable
from carstage_sim.world.sockets import actor_from_socket
from carstage_sim.world.spring_arm import Obstacle


@dataclass(slots=True)
class _Level:
    """Actors at one depth of riding.

    Attributes:
        rigid, parents: rows of the rigid ones and of their parents.
        parent_from_child: ``(R, 4, 4)``.
        carried: those that an arm or a bone carries.
    """

    rigid: NDArray[np.intp]
    parents: NDArray[np.intp]
    parent_from_child: FloatArray
    carried: list[Actor] = field(default_factory=list)


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
        self._levels = [_level(table, actors) for _, actors in sorted(levels.items())]

    def follow(self, table: ActorTable, delta_s: float, obstacle: Obstacle | None = None) -> None:
        """Move every attached actor to where its parent carries it.

        Velocity and acceleration are those of the point of attachment without the parent's
        rotation; the angular velocity is the parent's.

        Args:
            table: the live actors.
            delta_s: seconds of this tick, for what lags behind.
            obstacle: finds scenery that a spring arm must not go through.
        """
        for level in self._levels:
            rows, parents = level.rigid, level.parents
            world_from_parent = pose_matrix(table.location[parents], table.rotation_deg[parents])
            _place(table, rows, world_from_parent @ level.parent_from_child)
            _ride(table, rows, parents)
            for actor in level.carried:
                row, parent_row = table.row(actor.actor_id), table.row(actor.parent_id)
                _place(table, row, _carried(table, actor, delta_s, obstacle))
                _ride(table, row, parent_row)


def _level(table: ActorTable, actors: list[Actor]) -> _Level:
    carried = [actor for actor in actors if actor.arm is not None or actor.attachment.socket]
    rigid = [actor for actor in actors if actor not in carried]
    return _Level(
        table.rows(actor.actor_id for actor in rigid),
        table.rows(actor.parent_id for actor in rigid),
        pose_matrix(
            np.array([actor.relative.location for actor in rigid]).reshape(-1, 3),
            np.array([actor.relative.rotation_deg for actor in rigid]).reshape(-1, 3),
        ),
        carried,
    )


def _carried(
    table: ActorTable, actor: Actor, delta_s: float, obstacle: Obstacle | None
) -> FloatArray:
    """``(4, 4)`` world pose of an actor that an arm or a bone carries."""
    parent = table.get(actor.parent_id)
    world_from_parent = _matrix(table, actor.parent_id)
    if parent is not None and actor.attachment.socket:
        parent_from_socket = actor_from_socket(table, parent, actor.attachment.socket)
        if parent_from_socket is not None:
            world_from_parent = world_from_parent @ parent_from_socket
    if actor.arm is not None:
        world_from_parent = actor.arm.follow(world_from_parent, delta_s, obstacle)
    relative = pose_matrix(actor.relative.location, actor.relative.rotation_deg)
    matrix: FloatArray = world_from_parent @ relative
    return matrix


def _matrix(table: ActorTable, actor_id: int) -> FloatArray:
    row = table.row(actor_id)
    return pose_matrix(table.location[row], table.rotation_deg[row])


def _place(table: ActorTable, rows: int | NDArray[np.intp], world_from_child: FloatArray) -> None:
    table.location[rows] = world_from_child[..., :3, 3]
    table.rotation_deg[rows] = rotation_deg(world_from_child[..., :3, :3])


def _ride(table: ActorTable, rows: int | NDArray[np.intp], parents: int | NDArray[np.intp]) -> None:
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
