"""Who touched whom in a tick: what sensors of collisions report."""

from __future__ import annotations

from collections.abc import Sequence

from carstage_sim.world.contacts.boxes import TOWN
from carstage_sim.world.contacts.crashes import Touch
from carstage_sim.world.state import Collision


def collisions_of_tick(touches: Sequence[Touch], ids: Sequence[int]) -> tuple[Collision, ...]:
    """All collisions of the last step, in ascending order of their actors' ids.

    Args:
        touches: what the fleet ran into.
        ids: actor ids of the vehicles' rows, then those of what else can be hit.
    """
    found = [_collision(touch, ids) for touch in touches]
    return tuple(sorted(found, key=lambda c: (c.first_id, c.second_id, c.label, c.impulse)))


def _collision(touch: Touch, ids: Sequence[int]) -> Collision:
    x, y = touch.impulse.tolist()
    first = ids[touch.first]
    if touch.second == TOWN:
        return Collision(first, 0, (x, y, 0.0), touch.label)
    second = ids[touch.second]
    if first < second:
        return Collision(first, second, (x, y, 0.0))
    return Collision(second, first, (-x, -y, 0.0))
