"""Where a vehicle of an episode begins, as its specification says it."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Literal

from carstage.config.fields import path_text
from carstage.config.scene import Stand as ConfiguredStand
from carstage.errors import ConfigError
from carstage.plan.facts import ServerFacts
from carstage.spec import Stand

Spawn = Literal["random", "near_ego"] | int | ConfiguredStand


def plan_start(
    spawn: Spawn,
    facts: ServerFacts,
    town: str,
    draw: float,
    *field: str | int,
    taken: Collection[int] = (),
) -> dict[str, Any]:
    """A spawn point, a place of its own, or near the ego: keys of ``EgoSpec``.

    Args:
        spawn: as the configuration has it.
        facts: what the server offers.
        town: the map's name.
        draw: in [0, 1), for a random spawn point.
        field: path of ``spawn`` in the configuration.
        taken: spawn points of others: a random one is the next that is free.

    Raises:
        ConfigError: the map has no such spawn point.
    """
    count = facts.count(town)
    if isinstance(spawn, ConfiguredStand):
        place = Stand(x_m=spawn.x, y_m=spawn.y, z_m=spawn.z, yaw_deg=spawn.yaw_deg)
        return {"spawn_index": None, "spawn_place": place}
    if spawn == "near_ego":
        return {"spawn_index": None, "spawn_place": None, "near_ego": True}
    if spawn == "random":
        points = facts.maps[town]
        drawn = int(draw * points)
        free = ((drawn + step) % points for step in range(points))
        index = next((point for point in free if point not in taken), drawn)
        return {"spawn_index": index, "spawn_place": None}
    if count is not None and spawn >= count:
        raise ConfigError(
            f"{path_text(field)}: {town} has no spawn point {spawn}.",
            f"It has {count}, counted from 0; or use `random`.",
        )
    return {"spawn_index": spawn, "spawn_place": None}
