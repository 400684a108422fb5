"""What vehicles can hit besides each other and the town: walkers, props, traffic light poles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import rotation_matrix
from carstage_sim.maps.lights import HEAD_HEIGHT_M
from carstage_sim.world.actors import Actor, ActorTable
from carstage_sim.world.blueprints.props import has_shape
from carstage_sim.world.columns import Rotation
from carstage_sim.world.contacts.crashes import Others
from carstage_sim.world.state import ActorKind

WALKER_MASS_KG = 75.0
_POLE_HALF_WIDTH_M = 0.1
_POLE_DEPTH_M = 1.0
"""How far a pole reaches into the ground, which may slope."""


class Solids:
    """The boxes of one tick, and the walkers among them.

    Args:
        table: the live actors.

    Attributes:
        actors: what the rows of :attr:`others` belong to.
        others: the boxes; a fleet's step changes them in place.
    """

    def __init__(self, table: ActorTable) -> None:
        self._walkers = [w for w in table.of_kind(ActorKind.WALKER) if w.collides]
        props = [
            actor
            for actor in table.of_kind(ActorKind.OTHER)
            if actor.collides and has_shape(actor.type_id)
        ]
        self.actors: list[Actor] = [
            *self._walkers,
            *props,
            *table.of_kind(ActorKind.TRAFFIC_LIGHT),
        ]
        rows = table.rows(actor.actor_id for actor in self.actors)
        half_size = [
            (_POLE_HALF_WIDTH_M, _POLE_HALF_WIDTH_M)
            if actor.kind is ActorKind.TRAFFIC_LIGHT
            else actor.box_extent[:2]
            for actor in self.actors
        ]
        center = table.location[rows].copy()
        mass = np.zeros(len(rows))
        count = len(self._walkers)
        mass[:count] = 1.0 / WALKER_MASS_KG
        center[:count, 2] -= [walker.box_extent[2] for walker in self._walkers]
        velocity = table.velocity[rows, :2].copy()
        self._rows = rows[:count]
        self._before = center[:count, :2].copy(), velocity[:count].copy()
        self.others = Others(
            center=center,
            half_size=np.array(half_size, np.float64).reshape(-1, 2),
            yaw_rad=np.radians(table.rotation_deg[rows, Rotation.YAW]),
            span=_spans(self.actors, table.location[rows], table.rotation_deg[rows]),
            velocity=velocity,
            inverse_mass=mass,
            carrier=np.array([actor.parent_id for actor in self.actors], np.int64),
        )

    def pushed(self, table: ActorTable) -> tuple[list[Actor], NDArray[np.float64]]:
        """Moves the walkers that were hit out of the way.

        Returns:
            All walkers that can be hit, and the velocity that each was given, ``(N, 2)`` m/s.
        """
        count = len(self._walkers)
        place, velocity = self._before
        own = np.array([walker.simulate_physics for walker in self._walkers], np.bool_)
        moved = self.others.center[:count, :2] - place
        table.location[self._rows, :2] += np.where(own[:, None], moved, 0.0)
        return self._walkers, self.others.velocity[:count] - velocity


def _spans(
    actors: Sequence[Actor], location: NDArray[np.float64], rotation_deg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """``(N, 2)`` heights of undersides and tops of the actors' boxes, world metres."""
    if not actors:
        return np.zeros((0, 2))
    box_center = np.array([actor.box_center for actor in actors], np.float64)
    extent = np.array([actor.box_extent for actor in actors], np.float64)
    up = rotation_matrix(rotation_deg)[:, 2]
    middle = location[:, 2] + (up * box_center).sum(axis=1)
    half = (np.abs(up) * extent).sum(axis=1)
    poles = np.array([actor.kind is ActorKind.TRAFFIC_LIGHT for actor in actors])
    low = np.where(poles, location[:, 2] - _POLE_DEPTH_M, middle - half)
    high = np.where(poles, location[:, 2] + HEAD_HEIGHT_M, middle + half)
    return np.column_stack([low, high])
