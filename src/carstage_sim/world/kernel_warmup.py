"""Runs every kernel of the mechanics once, so that no client waits for the compiler."""

from __future__ import annotations

from carstage_sim.world.pose import Pose
from carstage_sim.world.world import World

_VEHICLE = "vehicle.tesla.model3"
_WALKER = "walker.pedestrian.0001"
_APART_M = 5.0


def warm_up_mechanics(world: World) -> None:
    """Compile or load all kernels of the mechanics by stepping a world like this one.

    Args:
        world: gives the town; it does not change.
    """
    trial = World(world.town, 0, previous=world)
    x, y, z = trial.town.entrance
    car = trial.spawn(_VEHICLE, {}, Pose((x, y, z)))
    trial.spawn(_WALKER, {}, Pose((x, y + _APART_M, z)))
    trial.set_target_velocity(car.actor_id, (1.0, 0.0, 0.0))  # what stands meets no walls
    trial.tick(0.05)
