"""Who touched whom in a tick: what sensors of collisions report."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.actors import ActorTable
from carstage_sim.world.contacts import find_contacts
from carstage_sim.world.state import ActorKind, Collision
from carstage_sim.world.vehicles import VehicleFleet

SENSOR_TYPE = "sensor.other.collision"

WALKER_MASS_KG = 75.0

FloatArray = NDArray[np.float64]


def collisions_of_tick(table: ActorTable, fleet: VehicleFleet) -> tuple[Collision, ...]:
    """All collisions of the last step, in ascending order of their actors' ids.

    Walkers are looked at only while a sensor could tell: nothing else depends on it, since walkers
    neither push vehicles nor are pushed.
    """
    found = _between_vehicles(fleet)
    if any(sensor.type_id == SENSOR_TYPE for sensor in table.of_kind(ActorKind.SENSOR)):
        found += _with_walkers(table, fleet)
    return tuple(sorted(found, key=lambda collision: (collision.first_id, collision.second_id)))


def _between_vehicles(fleet: VehicleFleet) -> list[Collision]:
    return [
        Collision(
            int(fleet.ids[contact.first]),
            int(fleet.ids[contact.second]),
            _in_space(contact.normal * impulse),
        )
        for contact, impulse in fleet.contacts
    ]


def _with_walkers(table: ActorTable, fleet: VehicleFleet) -> list[Collision]:
    walkers = [walker for walker in table.of_kind(ActorKind.WALKER) if walker.collides]
    if not walkers or not len(fleet):
        return []
    rows = table.rows(walker.actor_id for walker in walkers)
    place, extent = table.location[rows], np.array([walker.box_extent for walker in walkers])
    center, half_size, yaw_rad = fleet.footprints()
    reach = np.linalg.norm(half_size, axis=1)[:, None] + np.linalg.norm(extent[:, :2], axis=1)
    apart = np.linalg.norm(center[:, None, :2] - place[None, :, :2], axis=2)
    near = (apart < reach) & fleet.collides[:, None]
    found = []
    for vehicle, index in zip(*(axis.tolist() for axis in np.nonzero(near)), strict=True):
        contacts = find_contacts(
            np.stack([center[vehicle], place[index]]),
            np.stack([half_size[vehicle], extent[index, :2]]),
            np.array([yaw_rad[vehicle], np.radians(table.rotation_deg[rows[index], 1])]),
        )
        for contact in contacts:
            closing = (fleet.velocity[vehicle] - table.velocity[rows[index]])[:2] @ contact.normal
            give = fleet.inverse_mass[vehicle] + 1.0 / WALKER_MASS_KG
            impulse = _in_space(contact.normal * max(float(closing), 0.0) / give)
            ids = int(fleet.ids[vehicle]), walkers[index].actor_id
            found.append(_ordered(*ids, impulse))
    return found


def _ordered(first: int, second: int, impulse: tuple[float, float, float]) -> Collision:
    if first < second:
        return Collision(first, second, impulse)
    x, y, z = impulse
    return Collision(second, first, (-x, -y, -z))


def _in_space(horizontal: FloatArray) -> tuple[float, float, float]:
    x, y = horizontal.tolist()
    return (x, y, 0.0)
