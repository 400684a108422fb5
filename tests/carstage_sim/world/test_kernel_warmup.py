"""The warm-up leaves nothing to compile for the first tick, and the world as it was."""

from __future__ import annotations

import sys

from numba.core.dispatcher import Dispatcher

from carstage_sim.maps import Town
from carstage_sim.world.kernel_warmup import warm_up_mechanics
from carstage_sim.world.pose import Pose
from carstage_sim.world.world import World


def compiled() -> dict[str, int]:
    """How many versions of each kernel there are."""
    return {
        f"{name}.{key}": len(value.signatures)
        for name, module in list(sys.modules.items())
        if name.startswith("carstage_sim.")
        for key, value in vars(module).items()
        if isinstance(value, Dispatcher)
    }


def test_ticks_after_the_warm_up_compile_nothing(stage01: Town) -> None:
    world = World(stage01, 1)
    warm_up_mechanics(world)
    before = compiled()
    assert before["carstage_sim.world.vehicles.motion._move"] == 1
    for k, point in enumerate(stage01.spawn_points[:3].tolist()):
        car = world.spawn("vehicle.audi.tt", {}, Pose(tuple(point[:3])))
        world.set_target_velocity(car.actor_id, (float(k), 1.0, 0.0))
    world.spawn("walker.pedestrian.0002", {}, Pose(tuple(stage01.spawn_points[5, :3].tolist())))
    for _ in range(3):
        world.tick(0.05)
    assert compiled() == before


def test_the_warm_up_changes_nothing_in_the_world(stage01: Town) -> None:
    warmed, plain = World(stage01, 1), World(stage01, 1)
    warm_up_mechanics(warmed)
    assert [actor.actor_id for actor in warmed.actors] == [a.actor_id for a in plain.actors]
    assert (warmed.frame, warmed.next_stream_id) == (plain.frame, plain.next_stream_id)
