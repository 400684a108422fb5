"""Steps the events of an episode and tells how they stand."""

from __future__ import annotations

import random
from typing import Any, Dict, List, Mapping, Optional

from carstage.collector.comfort import ComfortableDriving
from carstage.collector.internals.errors import SceneError
from carstage.collector.scenario.base import Population
from carstage.collector.scenario.events.base import Event, event_class, make_event
from carstage.collector.scenario.events.surroundings import Surroundings
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec


def check_map(spec: EpisodeSpec, world_map: Any) -> None:
    """Refuse events that have no place anywhere on the map, before anything is recorded.

    Args:
        spec: the episode.
        world_map: ``carla.Map``.

    Raises:
        SceneError: names the event and what the map lacks.
    """
    for index, planned in enumerate(spec.scenario.events or ()):
        lacking = event_class(planned).lacking(world_map)
        if lacking is not None:
            raise SceneError(
                "scenario.events[%d]: map %s has no place for %s: %s."
                % (index, spec.map, planned.kind, lacking),
                "Choose another map, or leave the event out.",
            )


class EventRunner:
    """The events of an episode, each with random numbers of its own.

    Args:
        session: the episode's world.
        spec: the episode.
        population: who was spawned.
        traffic_manager_port: where the client's Traffic Manager listens.
        gently: who drives with comfort, by actor id.
    """

    def __init__(
        self,
        session: WorldSession,
        spec: EpisodeSpec,
        population: Population,
        traffic_manager_port: int,
        gently: Mapping[int, ComfortableDriving],
    ) -> None:
        planned = spec.scenario.events or ()
        rng = random.Random("%d events" % spec.seeds.driving)
        self._step_s = spec.step_s
        self._world = Surroundings(session, spec, population, traffic_manager_port, rng, gently)
        self._events: List[Event] = [make_event(event, self._world) for event in planned]

    def before_step(self, tick: Optional[int]) -> None:
        """Called ahead of each step: of a recorded tick, or None in the warm-up."""
        if tick is None:
            return
        self._world.time_s = tick * self._step_s
        for event in self._events:
            event.step()
        self._world.send()

    def states(self) -> List[Dict[str, Any]]:
        """One object for each planned event."""
        return [
            {
                "state": event.state,
                "actors": [actor.id for actor in event.actors],
                "reason": event.reason,
            }
            for event in self._events
        ]
