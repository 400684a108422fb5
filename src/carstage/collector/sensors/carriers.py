"""What carries a sensor: the ego, nothing (a place on the map), or an actor found by its type."""

from __future__ import annotations

from typing import Any, Dict, List, Optional

from carstage.collector.internals.errors import SceneError
from carstage.spec import EGO, ON_MAP, SensorSpec


class Carriers:
    """Finds the carriers of an episode's sensors; everybody must have been in a frame before.

    Args:
        world: ``carla.World``.
        ego: the ego's ``carla.Vehicle``.
    """

    def __init__(self, world: Any, ego: Any) -> None:
        self._world = world
        self._ego = ego
        self._by_pattern: Dict[str, List[Any]] = {}

    def carrier_of(self, sensor: SensorSpec, path: str) -> Optional[Any]:
        """The actor that carries a sensor; None for one that is fixed on the map.

        Raises:
            SceneError: fewer actors match than the sensor's index asks for.
        """
        if sensor.attach_to == EGO:
            return self._ego
        if sensor.attach_to == ON_MAP:
            return None
        found = self._matching(sensor.attach_to)
        if sensor.attach_index >= len(found):
            raise SceneError(
                "%s.attach_to: %d actors match %r; the sensor wants number %d."
                % (path, len(found), sensor.attach_to, sensor.attach_index),
                "Numbers count from 0. See vehicles.filter for what is spawned.",
            )
        return found[sensor.attach_index]

    def _matching(self, pattern: str) -> List[Any]:
        """Actors of a type, the nearest to the ego first, equally near ones by id."""
        if pattern not in self._by_pattern:
            here = self._ego.get_transform().location
            others = [a for a in self._world.get_actors().filter(pattern) if a.id != self._ego.id]
            others.sort(key=lambda a: (here.distance(a.get_transform().location), a.id))
            self._by_pattern[pattern] = others
        return self._by_pattern[pattern]
