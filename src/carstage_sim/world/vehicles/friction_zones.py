"""Friction triggers: boxes in which every tyre has another friction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.actors import Actor, ActorTable
from carstage_sim.world.columns import Rotation
from carstage_sim.world.contacts.overlap import overlaps
from carstage_sim.world.pose import Vector3

FloatArray = NDArray[np.float64]

TYPE_ID = "static.trigger.friction"
_CM_PER_M = 100.0


def zone_extent_m(trigger: Actor) -> Vector3:
    """Half sizes of a trigger's box; its attributes are in centimetres, as in CARLA."""
    x, y, z = (_number(trigger, f"extent_{axis}") / _CM_PER_M for axis in "xyz")
    return (x, y, z)


def zone_friction(
    triggers: list[Actor],
    table: ActorTable,
    center: FloatArray,
    half_size: FloatArray,
    yaw_rad: FloatArray,
) -> FloatArray:
    """Tyre friction that triggers impose on vehicles, ``(N,)``; NaN outside all of them.

    Where triggers overlap the one of the highest id counts. CARLA sets 3.5 when a vehicle
    leaves a trigger; here it has its own tyres again.

    Args:
        triggers: ascending ids.
        table: the live actors.
        center, half_size, yaw_rad: boxes of the vehicles, ``(N, 3)``, ``(N, 2)``, ``(N,)``.
    """
    friction = np.full(len(center), np.nan)
    extents = np.column_stack([half_size, np.full(len(center), 0.5)])
    for trigger in triggers:
        pose = table.pose(trigger.actor_id)
        inside = overlaps(
            np.asarray(pose.location),
            np.asarray(zone_extent_m(trigger)),
            pose.rotation_deg[Rotation.YAW],
            center,
            extents,
            np.degrees(yaw_rad),
        )
        friction[inside] = _number(trigger, "friction")
    return friction


def _number(trigger: Actor, name: str) -> float:
    """A trigger's attribute; CARLA's own defaults end in an ``f``. What is no number is 0."""
    try:
        value = float(trigger.attributes.get(name, "0").rstrip("f"))
    except ValueError:
        return 0.0
    return value if np.isfinite(value) else 0.0
