"""Wheels that steer and turn: near a sensor, those of a vehicle are instances of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.mesh import TriangleMesh
from carstage_sim.render.scene import Placement
from carstage_sim.world.blueprints import Blueprint
from carstage_sim.world.state import ActorKind, WorldState

BODY = "+body"
"""Ends the keys of vehicles without wheels."""
WHEEL = "+wheel"
"""Before the number in the key of a vehicle's wheel."""
NEAR_M = 30.0
"""How near to a sensor a vehicle's wheels are instances: further away they are small."""
_MOST_STEER_DEG = 40.0
"""Of a wheel that is drawn: there is no room for CARLA's 70 degrees below a body."""
_STICKS_OUT_M = 0.05
"""Most that a steered wheel may stick out beside a straight one. Real ones do so, too."""

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class WheelPlaces:
    """Where a vehicle's wheels are on it, in its own frame.

    Attributes:
        centre: ``(W, 3)`` metres.
        radius_m, half_width_m: ``(W,)``.
        steers: ``(W,)`` whether it follows the steering.
        room_m: ``(W,)`` how far it may stick out.
    """

    centre: FloatArray
    radius_m: FloatArray
    half_width_m: FloatArray
    steers: NDArray[np.bool_]
    room_m: FloatArray

    @classmethod
    def of(cls, wheels: list[TriangleMesh], box_half_width_m: float) -> WheelPlaces:
        """From the wheels' meshes, which stand straight, and the vehicle's box."""
        bounds = np.array([wheel.bounds for wheel in wheels], np.float64)
        centre, half = bounds.mean(axis=1), np.ptp(bounds, axis=1) / 2.0
        room = box_half_width_m - np.abs(centre[:, 1]) - half[:, 1]
        return cls(
            centre,
            half[:, 2],
            half[:, 1],
            # The front wheel of a two-wheeler is held by a fork, which is part of the body.
            (centre[:, 0] > 0.0) & (len(wheels) > 2),
            np.clip(room, 0.0, _STICKS_OUT_M),
        )

    @classmethod
    def of_all(cls, vehicles: Sequence[WheelPlaces]) -> WheelPlaces:
        """The wheels of several vehicles, one after the other."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(v, name) for v in vehicles]) for name in names))


class WheelPoses(NamedTuple):
    """How wheels differ from where they are made, in their vehicle's frame.

    Attributes:
        rotation: ``(W, 3, 3)``.
        shift: ``(W, 3)`` metres, after the rotation.
    """

    rotation: FloatArray
    shift: FloatArray


class LooseWheels:
    """Places the wheels of the vehicles near a sensor.

    Args:
        blueprints: by their ids.
        mesh: gives the mesh of a wheel's key.
    """

    def __init__(
        self, blueprints: Mapping[str, Blueprint], mesh: Callable[[str], TriangleMesh]
    ) -> None:
        self._blueprints = blueprints
        self._mesh = mesh
        self._known: dict[str, tuple[tuple[str, ...], WheelPlaces]] = {}

    def keys(self, type_id: str) -> tuple[str, ...]:
        """Model keys of the wheels of a blueprint."""
        count = int(self._blueprints[type_id].attribute("number_of_wheels").value)
        return tuple(f"{type_id}{WHEEL}{number}" for number in range(count))

    def placements(self, state: WorldState, rotations: FloatArray) -> dict[int, list[Placement]]:
        """The wheels that are instances, by the row of their vehicle.

        Args:
            state: the world.
            rotations: ``(N, 3, 3)`` world_from_actor of its rows.
        """
        rows = near_sensors(state)
        if state.doors is not None:
            rows = rows[state.doors[rows] == 0]  # who has a door open stands
        if not len(rows):
            return {}
        known = [self._of(state.type_id[row]) for row in rows.tolist()]
        owner = np.repeat(rows, [len(keys) for keys, _ in known])
        poses = wheel_poses(
            WheelPlaces.of_all([places for _, places in known]),
            state.wheel_angle_deg[owner].astype(np.float64),
            state.rolled_m[owner],
        )
        location = state.location[owner] + turned(rotations[owner], poses.shift)
        rotation = turned(rotations[owner], poses.rotation)
        actor_ids, found = state.actor_id.tolist(), {}
        number = 0
        for row, (keys, _) in zip(rows.tolist(), known, strict=True):
            of_row = range(number, number + len(keys))
            found[row] = [
                Placement(actor_ids[row], key, location[k], rotation[k])
                for key, k in zip(keys, of_row, strict=True)
            ]
            number += len(keys)
        return found

    def _of(self, type_id: str) -> tuple[tuple[str, ...], WheelPlaces]:
        """Keys of a blueprint's wheels, and where they are."""
        known = self._known.get(type_id)
        if known is None:
            keys, blueprint = self.keys(type_id), self._blueprints[type_id]
            meshes = [self._mesh(key) for key in keys]
            known = keys, WheelPlaces.of(meshes, blueprint.box_extent[1])
            self._known[type_id] = known
        return known


def near_sensors(state: WorldState) -> NDArray[np.intp]:
    """Rows of the vehicles that have a sensor of the world nearby."""
    rows = np.flatnonzero(state.kind == ActorKind.VEHICLE)
    sensors = state.location[state.kind == ActorKind.SENSOR]
    if not len(rows) or not len(sensors):
        return rows[:0]
    away = state.location[rows, None] - sensors
    near: NDArray[np.bool_] = ((away**2).sum(axis=2) < NEAR_M**2).any(axis=1)
    return np.asarray(rows[near], np.intp)


def wheel_poses(places: WheelPlaces, steer_deg: FloatArray, rolled_m: FloatArray) -> WheelPoses:
    """Poses of wheels.

    Args:
        places: of the wheels, of any vehicles.
        steer_deg: ``(W,)`` of their vehicles, positive to the right.
        rolled_m: ``(W,)`` ways of their vehicles.
    """
    limited = np.clip(steer_deg, -_MOST_STEER_DEG, _MOST_STEER_DEG)
    steer = np.radians(np.where(places.steers, limited, 0.0))
    spin = np.remainder(rolled_m / places.radius_m, 2.0 * np.pi)
    c, s, cs, ss = np.cos(steer), np.sin(steer), np.cos(spin), np.sin(spin)
    rotation = np.zeros((len(steer), 3, 3))
    rotation[:, 0, 0], rotation[:, 0, 1], rotation[:, 0, 2] = c * cs, -s, c * ss
    rotation[:, 1, 0], rotation[:, 1, 1], rotation[:, 1, 2] = s * cs, c, s * ss
    rotation[:, 2, 0], rotation[:, 2, 2] = -ss, cs
    shift = places.centre - turned(rotation, places.centre)
    # About its own middle a wheel would reach out of the body: it gives way to the inside.
    reach = places.half_width_m * (c - 1.0) + places.radius_m * np.abs(s)
    shift[:, 1] -= np.sign(places.centre[:, 1]) * np.maximum(reach - places.room_m, 0.0)
    return WheelPoses(rotation, shift)


def turned(rotation: FloatArray, vectors: FloatArray) -> FloatArray:
    """``(N, 3)`` or ``(N, 3, K)`` of as many vectors or matrices behind ``(N, 3, 3)`` rotations.

    Sums written out: a matrix product may add in another order on another machine.
    """
    columns = vectors if vectors.ndim == 3 else vectors[:, :, None]
    product = sum(rotation[:, :, k, None] * columns[:, k, None, :] for k in range(3))
    return np.asarray(product).reshape(vectors.shape)
