"""Bones of actors: where things can be attached (0.9.16's ``bone`` of ``spawn_actor``).

A walker's bones move with its figure. A vehicle has the bones that CARLA asks of every vehicle
model: the base and one for each wheel, here unsteered. Other actors have none.
"""

from __future__ import annotations

import numpy as np

from carstage_sim.content.skeleton import BONES
from carstage_sim.geometry import FloatArray, pose_matrix
from carstage_sim.world.actors import Actor, ActorTable
from carstage_sim.world.state import ActorKind
from carstage_sim.world.walkers.bones import actor_from_bone, actor_from_bones

_BASE = "Vehicle_Base"
_FOUR_WHEELS = ("Wheel_Front_Left", "Wheel_Front_Right", "Wheel_Rear_Left", "Wheel_Rear_Right")
_TWO_WHEELS = ("Wheel_Front", "Wheel_Rear")


def bone_names(actor: Actor) -> list[str]:
    """Names of an actor's bones, in the order of their transforms."""
    if actor.kind is ActorKind.WALKER:
        return [bone.name for bone in BONES]
    return list(_vehicle_bones(actor))


def actor_from_all_bones(table: ActorTable, actor: Actor) -> list[FloatArray]:
    """``(4, 4)`` poses of all bones in a live actor's frame, in the order of their names."""
    if actor.kind is ActorKind.WALKER:
        return actor_from_bones(table, actor)
    return list(_vehicle_bones(actor).values())


def actor_from_socket(table: ActorTable, actor: Actor, name: str) -> FloatArray | None:
    """``(4, 4)`` pose of one bone in a live actor's frame; None where it has no such bone."""
    if actor.kind is ActorKind.WALKER:
        return actor_from_bone(table, actor, name)
    return _vehicle_bones(actor).get(name)


def _vehicle_bones(actor: Actor) -> dict[str, FloatArray]:
    if actor.blueprint is None or actor.blueprint.vehicle is None:
        return {}
    vehicle = actor.blueprint.vehicle
    if vehicle.track_m > 0.0:
        named = zip(_FOUR_WHEELS, vehicle.wheels, strict=True)
    else:
        named = zip(_TWO_WHEELS, vehicle.wheels[::2], strict=True)
    found: dict[str, FloatArray] = {_BASE: np.eye(4)}
    for name, wheel in named:
        found[name] = pose_matrix(wheel.position_m, (0.0, 0.0, 0.0))
    return found
