"""The seam of the events: a state, a step of the world, and who takes part."""

from __future__ import annotations

import sys
from typing import Any, Callable, Dict, List, Optional, Type, TypeVar

from carstage.collector.internals.errors import SceneError
from carstage.collector.scenario.events.surroundings import Surroundings
from carstage.sensor_kinds import load_object
from carstage.spec import EventSpec

WAITING, PLACED, RUNNING, ENDED = "waiting", "placed", "running", "ended"

LOOK_EVERY_S = 0.4
"""How often a place is looked for."""
GONE_M = 70.0
"""So far from the ego, what an event has brought is taken away after its end."""


class Event:
    """One event of an episode; it never raises because it cannot happen.

    ``waiting`` for a place, ``placed`` until it begins, ``running``, ``ended``. What is placed in
    vain is taken away, and a place is looked for again. Meanwhile the ego changes no lanes.

    Args:
        spec: what is asked for.
        world: what is around the ego.

    Attributes:
        state: one of these words.
        reason: why it has not begun.
        actors: who takes part; the first is the one that acts.
        adopted: they were there before, and stay.
    """

    def __init__(self, spec: Any, world: Surroundings) -> None:
        self.spec = spec
        self.world = world
        self.state = WAITING
        self.reason = "its time has not come"
        self.actors: List[Any] = []
        self.adopted = False
        self._since_s = 0.0
        self._next_look_s = 0.0

    @classmethod
    def lacking(cls, world_map: Any) -> Optional[str]:
        """What a map has nowhere and this kind needs; None: nothing."""
        del world_map
        return None

    def place(self) -> Optional[str]:
        """Spawn who takes part, or say why that is not possible now.

        Returns:
            None when everybody is there.
        """
        raise NotImplementedError

    def wait(self) -> Optional[str]:
        """A step between being placed and beginning.

        Returns:
            Why it cannot begin here any more; else None.
        """
        raise NotImplementedError

    def run(self) -> bool:
        """A step of what happens; return whether it goes on."""
        raise NotImplementedError

    def release(self) -> None:
        """Leave behind who took part; by default they stay where they are until they are gone."""

    def after(self) -> None:
        """A step after its end, while who took part is near; by default nothing."""

    def removed(self) -> None:
        """Give back what holds for others, once who took part is gone; by default nothing."""

    def begin(self) -> None:
        """For :meth:`wait`: from this step on it happens."""
        self._enter(RUNNING)
        self.reason = ""

    def give_up(self, reason: str) -> None:
        """Take away who was placed, and look for another place."""
        self.reason = reason
        self._leave()
        self._enter(WAITING)
        self.world.keep_lane(self, False)

    @property
    def elapsed_s(self) -> float:
        """How long it has been in its state."""
        return self.world.time_s - self._since_s

    def step(self) -> None:
        """Called ahead of each recorded step."""
        if self.state == WAITING:
            self._look()
        elif self.state == PLACED:
            given_up = self.wait()
            if given_up is not None:
                self.give_up(given_up)
        elif self.state == RUNNING:
            if not self.run():
                self._enter(ENDED)
                self.world.keep_lane(self, False)
                self.release()
        elif self.actors and not self.adopted:
            if self.world.is_far(self.actors, GONE_M):
                self._leave()
            else:
                self.after()

    def _look(self) -> None:
        now_s = self.world.time_s
        if now_s + 1e-9 < max(self.spec.at_s, self._next_look_s):
            return
        self._next_look_s = now_s + LOOK_EVERY_S
        reason = self.place()
        if reason is None:
            self.reason = "it was placed, and the episode ended before it began"
            self._enter(PLACED)
            self.world.keep_lane(self, True)
        else:
            self.reason = reason
            self._leave()

    def _leave(self) -> None:
        if self.adopted:
            self.release()
        else:
            self.world.remove(self.actors)
        self.actors, self.adopted = [], False
        self.removed()

    def _enter(self, state: str) -> None:
        self.state = state
        self._since_s = self.world.time_s


EVENTS: Dict[str, Type[Event]] = {}
"""Kind to class, filled by :func:`event`."""

EventClass = TypeVar("EventClass", bound=Type[Event])


def event(kind: str) -> Callable[[EventClass], EventClass]:
    """Class decorator that adds a kind of event."""

    def add(cls: EventClass) -> EventClass:
        EVENTS[kind] = cls
        return cls

    return add


def event_class(spec: EventSpec) -> Type[Event]:
    """The class that makes an event happen; one of another package is named by its specification.

    Raises:
        SceneError: another package has none.
    """
    if not spec.collector:
        return EVENTS[spec.kind]
    try:
        cls: Type[Event] = load_object(spec.collector)
    except ImportError as error:
        raise SceneError(
            "scenario.events: %s of event %s cannot be imported: %s."
            % (spec.collector, spec.kind, error),
            "Install its package for the collector's Python, %s." % sys.executable,
        ) from error
    return cls


def make_event(spec: EventSpec, world: Surroundings) -> Event:
    """The event that is asked for."""
    return event_class(spec)(spec, world)
