"""Vehicles that run into each other, into walkers and props, and into the town."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.columns import Rotation
from carstage_sim.world.contacts.boxes import Contact, axes_of, find_contacts
from carstage_sim.world.contacts.impulses import Bodies, resolve
from carstage_sim.world.contacts.obstacles import Obstacles
from carstage_sim.world.vehicles.rows import VehicleRows

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

GROUND_CLEARANCE_M = 0.21
"""Between the road and a car's underside: scenarios have cars drive over heaps of 0.2 m."""
LONGEST_WAY_M = 0.4
"""How far a vehicle may move between two looks: less than half its width, or it could end up with
its middle behind a wall."""


@dataclass(frozen=True, slots=True)
class Others:
    """Boxes that are no vehicles but can be hit; changed in place when they are.

    Attributes:
        center: ``(M, 3)`` world metres.
        half_size: ``(M, 2)`` metres.
        yaw_rad: ``(M,)``.
        span: ``(M, 2)`` heights of underside and top, world metres.
        velocity: ``(M, 2)`` m/s.
        inverse_mass: ``(M,)`` 1/kg; 0 for what cannot be pushed.
        carrier: ``(M,)`` int64 id of the actor that each is attached to, 0 for none.
    """

    center: FloatArray
    half_size: FloatArray
    yaw_rad: FloatArray
    span: FloatArray
    velocity: FloatArray
    inverse_mass: FloatArray
    carrier: NDArray[np.int64]


NOTHING = Others(
    np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2)),
    np.zeros(0), np.zeros(0, np.int64),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Touch:
    """Two bodies that touched within a tick.

    Attributes:
        first: row of a vehicle.
        second: row of another vehicle, number of vehicles + row in :class:`Others`, or
            :data:`~carstage_sim.world.contacts.boxes.TOWN`.
        impulse: ``(2,)`` N s that the second one got in all, world.
        label: semantic label of what of the town was touched.
    """

    first: int
    second: int
    impulse: FloatArray
    label: int


class Crashes:
    """Finds contacts of a fleet, resolves them, and keeps what touched within a tick.

    Args:
        obstacles: outlines of the town, None for none.
    """

    def __init__(self, obstacles: Obstacles | None) -> None:
        self._obstacles = obstacles
        self._others = NOTHING
        self._impulses: dict[tuple[int, int, int, int], FloatArray] = {}

    def begin(self, others: Others) -> None:
        """A tick begins: nothing has touched yet."""
        self._others = others
        self._impulses = {}

    @property
    def touches(self) -> list[Touch]:
        """What touched since the tick began, each pair once."""
        return [
            Touch(first, second, impulse, label)
            for (first, second, _, label), impulse in sorted(
                self._impulses.items(), key=lambda item: item[0]
            )
        ]

    def look(self, rows: VehicleRows) -> None:
        """Parts what is in each other and exchanges momentum, in place."""
        count = len(rows.ids)
        center, yaw_rad = centers(rows)
        contacts = self._contacts(rows, center, yaw_rad)
        if not contacts:
            return
        bodies = self._bodies(rows, center, yaw_rad)
        before = bodies.center[:, :2].copy()
        impulses = resolve(contacts, bodies)
        for contact, impulse in zip(contacts, impulses, strict=True):
            key = (contact.first, contact.second, contact.object_id, contact.label)
            self._impulses[key] = self._impulses.get(key, np.zeros(2)) + impulse
        touched = {row for contact in contacts for row in (contact.first, contact.second)}
        hit = np.array([row for row in sorted(touched) if 0 <= row < count], np.int64)
        _take_over(rows, hit[rows.simulated[hit]], bodies, bodies.center[:, :2] - before)
        self._others.center[:, :2] = bodies.center[count:, :2]
        self._others.velocity[:] = bodies.velocity[count:]

    def _contacts(
        self, rows: VehicleRows, center: FloatArray, yaw_rad: FloatArray
    ) -> list[Contact]:
        others, count = self._others, len(rows.ids)
        found = [
            contact
            for contact in find_contacts(
                np.concatenate([center, others.center]),
                np.concatenate([rows.half_size, others.half_size]),
                np.concatenate([yaw_rad, others.yaw_rad]),
                np.concatenate([_span(rows), others.span]),
            )
            if contact.first < count
            and rows.collides[contact.first]
            and (
                # What a vehicle carries moves after it, and would push it in between.
                others.carrier[contact.second - count] != rows.ids[contact.first]
                if contact.second >= count
                else rows.collides[contact.second]
            )
        ]
        if self._obstacles is not None:
            moving = (rows.speed != 0.0) | (rows.slide != 0.0) | (rows.spin != 0.0)
            looked_at = np.flatnonzero(rows.simulated & rows.collides & moving)
            found += self._obstacles.contacts(looked_at, center, rows.half_size, yaw_rad)
        return found

    def _bodies(self, rows: VehicleRows, center: FloatArray, yaw_rad: FloatArray) -> Bodies:
        others = self._others
        forward, right = np.swapaxes(axes_of(yaw_rad), 0, 1)
        turn = rows.turn_rate + rows.spin
        aside = rows.slide + turn * (rows.box_center_x - rows.rear_axle_x)
        velocity = rows.speed[:, None] * forward + aside[:, None] * right
        velocity = np.where(rows.simulated[:, None], velocity, rows.velocity[:, :2])
        nothing = np.zeros(len(others.center))
        free = rows.simulated
        return Bodies(
            center=np.concatenate([center, others.center]),
            half_size=np.concatenate([rows.half_size, others.half_size]),
            yaw_rad=np.concatenate([yaw_rad, others.yaw_rad]),
            velocity=np.concatenate([velocity, others.velocity]),
            spin=np.concatenate([np.where(free, turn, 0.0), nothing]),
            inverse_mass=np.concatenate(
                [np.where(free, rows.inverse_mass, 0.0), others.inverse_mass]
            ),
            inverse_inertia=np.concatenate([np.where(free, rows.inverse_inertia, 0.0), nothing]),
        )


def _span(rows: VehicleRows) -> FloatArray:
    """``(N, 2)`` heights of the vehicles' undersides and roofs; what is lower, they drive over."""
    ground = rows.location[:, 2]
    return np.column_stack([ground + GROUND_CLEARANCE_M, ground + rows.height])


def centers(rows: VehicleRows) -> tuple[FloatArray, FloatArray]:
    """Middles of the vehicles' boxes ``(N, 3)`` and their yaws (rad)."""
    yaw_rad = np.radians(rows.rotation_deg[:, Rotation.YAW])
    center = rows.location.copy()
    center[:, 0] += rows.box_center_x * np.cos(yaw_rad)
    center[:, 1] += rows.box_center_x * np.sin(yaw_rad)
    return center, yaw_rad


def _take_over(
    rows: VehicleRows, hit: NDArray[np.int64], bodies: Bodies, moved: FloatArray
) -> None:
    """Writes the bodies' motion back: as speed, and as slide and spin that the tyres will damp."""
    forward, right = np.swapaxes(axes_of(bodies.yaw_rad[hit]), 0, 1)
    speed = np.einsum("nk,nk->n", bodies.velocity[hit], forward)
    aside = np.einsum("nk,nk->n", bodies.velocity[hit], right)
    before = rows.speed[hit]
    # The wheels go on to steer, as much as the speed that is left makes of it.
    rolls_on = np.where(np.abs(before) > 0.1, speed / np.where(before == 0.0, 1.0, before), 0.0)
    steered = rows.turn_rate[hit] * np.clip(rolls_on, -1.0, 1.0)
    spin = bodies.spin[hit] - steered
    lever = rows.box_center_x[hit] - rows.rear_axle_x[hit]
    rows.location[hit, :2] += moved[hit]
    rows.speed[hit] = speed
    rows.turn_rate[hit] = steered
    rows.spin[hit] = spin
    rows.slide[hit] = aside - (steered + spin) * lever
