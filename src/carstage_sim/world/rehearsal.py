"""A first tick that nobody sees, so that no client waits for a compiler."""

from __future__ import annotations

from carstage_sim.world.pose import Pose
from carstage_sim.world.world import World

_VEHICLE = "vehicle.tesla.model3"
_WALKER = "walker.pedestrian.0001"
_APART_M = 5.0


def rehearse(world: World) -> None:
    """Compiles, or loads, all kernels of the mechanics by stepping a world like this one.

    Args:
        world: gives the town; it does not change.
    """
    stage = World(world.town, 0, previous=world)
    x, y, z = stage.town.entrance
    car = stage.spawn(_VEHICLE, {}, Pose((x, y, z)))
    stage.spawn(_WALKER, {}, Pose((x, y + _APART_M, z)))
    stage.set_target_velocity(car.actor_id, (1.0, 0.0, 0.0))  # what stands meets no walls
    stage.tick(0.05)
