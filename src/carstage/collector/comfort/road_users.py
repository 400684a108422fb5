"""Who else is on the road: known by the snapshots that the client has anyway."""

from __future__ import annotations

from operator import attrgetter
from typing import Any, Dict, List, NamedTuple, Set

_ON_THE_ROAD = ("vehicle.", "walker.")
_actor_id = attrgetter("id")


class RoadUser(NamedTuple):
    """A vehicle or a walker.

    Attributes:
        id: of the actor.
        half_m: half its length.
    """

    id: int
    half_m: float


class RoadUsers:
    """Vehicles and walkers of a world, whoever spawned them.

    Args:
        world: ``carla.World``.
    """

    def __init__(self, world: Any) -> None:
        self._world = world
        self._known: Set[int] = set()
        self._users: Dict[int, RoadUser] = {}

    def near(self, snapshot: Any, x: float, y: float, within_m: float, but: int) -> List[RoadUser]:
        """Those within a distance of a place, by id.

        Args:
            snapshot: ``carla.WorldSnapshot``.
            x, y: the place.
            within_m: the distance.
            but: id of one that is left out.
        """
        self._meet(snapshot)
        found, squared = [], within_m * within_m
        for user in list(self._users.values()):
            state = snapshot.find(user.id)
            if state is None:
                del self._users[user.id]
                continue
            there = state.get_transform().location
            dx, dy = there.x - x, there.y - y
            if dx * dx + dy * dy < squared and user.id != but:
                found.append(user)
        return found

    def _meet(self, snapshot: Any) -> None:
        """Look at actors that no earlier snapshot had."""
        if self._known.issuperset(map(_actor_id, snapshot)):
            return
        new = sorted(set(map(_actor_id, snapshot)) - self._known)
        self._known.update(new)
        for actor in sorted(self._world.get_actors(new), key=lambda one: int(one.id)):
            if actor.type_id.startswith(_ON_THE_ROAD):
                user = RoadUser(int(actor.id), float(actor.bounding_box.extent.x))
                self._users[user.id] = user
