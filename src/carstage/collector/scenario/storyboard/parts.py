"""The parts of a storyboard at work: what has begun, what ends, what begins now."""

from __future__ import annotations

import logging
import math
from typing import Dict, Iterator, List, NamedTuple, Sequence, Tuple

from carstage.collector.scenario.events.base import ENDED, PLACED
from carstage.collector.scenario.events.base import RUNNING as RUNS
from carstage.collector.scenario.storyboard.conditions import (
    COMPLETE,
    RUNNING,
    STANDBY,
    PartKey,
    StoryState,
    Waiting,
)
from carstage.collector.scenario.storyboard.movers import OVER, Change, Mover
from carstage.spec import StoryboardSpec
from carstage.spec.storyboard import (
    StoryAct,
    StoryAction,
    StoryEvent,
    StoryGroup,
    StoryLaneChange,
    StoryManeuver,
    StorySpeed,
)

STARTS, ENDS, STOPS, SKIPS = (
    "startTransition",
    "endTransition",
    "stopTransition",
    "skipTransition",
)

_log = logging.getLogger(__name__)


class PartState(NamedTuple):
    """How an event or an action stands, in the words of the record.

    Attributes:
        state: ``placed``, ``running`` or ``ended``.
        reason: why it has not begun.
        execution: number of the time that it happens, or happened last, from 1.
    """

    state: str
    reason: str
    execution: int


def waits(spec: StoryEvent, reason: str) -> Iterator[PartState]:
    """An event that has not begun, and its actions."""
    return iter([PartState(PLACED, reason, 1)] * (1 + len(spec.actions)))


class PlayedEvent:
    """An event: waits, runs until all its actions are over, and may happen again.

    Args:
        spec: the event.
        actors: who carries it out.
        movers: everybody who moves, by name.
        world: what conditions look at.
    """

    def __init__(
        self,
        spec: StoryEvent,
        actors: Sequence[str],
        movers: Dict[str, Mover],
        world: StoryState,
    ) -> None:
        self._spec = spec
        self._actors = actors
        self._movers = movers
        self._world = world
        self._left = spec.most
        self._running: Dict[int, List[Change]] = {}
        self._executions = 0
        self._begun_s = -math.inf
        self._reason = "its trigger did not hold"
        self.state = STANDBY
        self._wait()

    def _wait(self) -> None:
        start = self._spec.start
        self._waiting = None if start is None else Waiting(start, self._world)

    @property
    def _key(self) -> PartKey:
        return ("event", self._spec.name)

    def states(self) -> Iterator[PartState]:
        """How it stands, then how its actions do."""
        if not self._executions:
            yield from waits(self._spec, self._reason)
            return
        yield self._part_state(self.state == RUNNING)
        for number in range(len(self._spec.actions)):
            yield self._part_state(number in self._running)

    def _part_state(self, is_running: bool) -> PartState:
        return PartState(RUNS if is_running else ENDED, "", self._executions)

    def _action_key(self, number: int) -> PartKey:
        return ("action", self._spec.actions[number].name)

    def finish(self) -> None:
        """End the actions that are over, and the event with the last of them."""
        if self.state != RUNNING:
            return
        for number, changes in list(self._running.items()):
            if all(change.is_over for change in changes):
                del self._running[number]
                self._world.ended(self._action_key(number), ENDS, COMPLETE)
        if not self._running:
            self._left -= 1
            self._rest()
            self._world.ended(self._key, ENDS, self.state)

    def look(self, others: Sequence[PlayedEvent]) -> None:
        """Begin if its trigger holds, as its priority allows beside others of its maneuver."""
        if self.state != STANDBY or (self._waiting is not None and not self._waiting.holds()):
            return
        running = [each for each in others if each is not self and each.state == RUNNING]
        if running and self._spec.priority == "skip":
            self._left -= 1
            self._reason = "another event of its maneuver was running"
            self._rest()
            self._world.changed(self._key, SKIPS, self.state)
            return
        if self._spec.priority == "override":
            for each in running:
                each.stop()
        self.state = RUNNING
        self._executions += 1
        self._begun_s = self._world.time_s
        self._world.changed(self._key, STARTS, RUNNING)
        for number, action in enumerate(self._spec.actions):
            self._running[number] = [self._act(name, action) for name in self._actors]
            self._world.changed(self._action_key(number), STARTS, RUNNING)
        _log.info("%.2f s: event %s begins", self._world.time_s, self._spec.name)

    def stop(self) -> None:
        """End before its time; who acts goes on as it is."""
        for number, changes in self._running.items():
            for change in changes:
                change.leave()
            self._world.changed(self._action_key(number), STOPS, COMPLETE)
        self._running = {}
        if self.state == RUNNING and self._begun_s == self._world.time_s:
            self._executions -= 1  # no step has shown it
            self._reason = "it was stopped in the step in which it began"
        elif self.state == STANDBY:
            self._reason = "it was stopped before its trigger held"
        if self.state != COMPLETE:
            self.state = COMPLETE
            self._world.changed(self._key, STOPS, COMPLETE)

    def _rest(self) -> None:
        self.state = STANDBY if self._left > 0 else COMPLETE
        self._wait()

    def _act(self, name: str, action: StoryAction) -> Change:
        mover, world = self._movers[name], self._world
        if isinstance(action, StoryLaneChange):
            return mover.change_lane(action.left, action.lane, action.dynamics)
        if not isinstance(action, StorySpeed):
            mover.teleport(world.places.transform(action.place))
            return OVER
        target_m_s = action.target
        if action.other is not None:
            others_m_s = world.users.body(action.other).speed_m_s
            target_m_s = others_m_s * target_m_s if action.is_factor else others_m_s + target_m_s
        return mover.change_speed(target_m_s, action.dynamics)


class PlayedManeuver:
    """Events of a maneuver.

    Args:
        spec: the maneuver.
        group: who carries it out.
        movers: everybody who moves, by name.
        world: what conditions look at.
    """

    def __init__(
        self, spec: StoryManeuver, group: StoryGroup, movers: Dict[str, Mover], world: StoryState
    ) -> None:
        self.key: PartKey = ("maneuver", spec.name)
        self.events = [PlayedEvent(each, group.actors, movers, world) for each in spec.events]

    @property
    def is_over(self) -> bool:
        """Whether all its events are."""
        return all(event.state == COMPLETE for event in self.events)


class PlayedAct:
    """An act: waits, runs until all its maneuvers are over or its stop trigger holds.

    Args:
        spec: the act.
        movers: everybody who moves, by name.
        world: what conditions look at.
    """

    def __init__(self, spec: StoryAct, movers: Dict[str, Mover], world: StoryState) -> None:
        self._spec = spec
        self._world = world
        self._movers = movers
        self._state = STANDBY
        self._start = None if spec.start is None else Waiting(spec.start, world)
        self._stop = Waiting(spec.stop, world)
        self._groups: List[Tuple[PartKey, List[PlayedManeuver]]] = []
        self._running: List[PartKey] = []

    def states(self) -> Iterator[PartState]:
        """How each event stands, followed by its actions."""
        if self._groups:
            for maneuver in self._maneuvers():
                for event in maneuver.events:
                    yield from event.states()
            return
        for group in self._spec.groups:
            for each in group.maneuvers:
                for planned in each.events:
                    yield from waits(planned, "its act did not begin")

    def finish(self) -> None:
        """End what is over."""
        if self._state != RUNNING:
            return
        for maneuver in self._maneuvers():
            for event in maneuver.events:
                event.finish()
        over = [maneuver.key for maneuver in self._maneuvers() if maneuver.is_over]
        over += [key for key, each in self._groups if all(one.is_over for one in each)]
        if len(over) == len(self._groups) + len(self._maneuvers()):
            over.append(("act", self._spec.name))
            self._state = COMPLETE
        for key in over:
            if key in self._running:
                self._running.remove(key)
                self._world.ended(key, ENDS, COMPLETE)

    def look(self) -> None:
        """Begin, stop, or have events begin, as the triggers say."""
        if self._state == STANDBY and (self._start is None or self._start.holds()):
            self._begin()
        if self._state != RUNNING:
            return
        if self._stop.holds():
            self.stop()
            return
        for maneuver in self._maneuvers():
            for event in maneuver.events:
                event.look(maneuver.events)

    def stop(self) -> None:
        """End before its time."""
        for maneuver in self._maneuvers():
            for event in maneuver.events:
                event.stop()
        for key in self._running:
            self._world.changed(key, STOPS, COMPLETE)
        self._running = []
        self._state = COMPLETE

    def _begin(self) -> None:
        self._state = RUNNING
        for group in self._spec.groups:
            maneuvers = [
                PlayedManeuver(each, group, self._movers, self._world) for each in group.maneuvers
            ]
            self._groups.append((("maneuverGroup", group.name), maneuvers))
        self._running = [("act", self._spec.name), *(key for key, _ in self._groups)]
        self._running += [maneuver.key for maneuver in self._maneuvers()]
        for key in self._running:
            self._world.changed(key, STARTS, RUNNING)

    def _maneuvers(self) -> List[PlayedManeuver]:
        return [maneuver for _, group in self._groups for maneuver in group]


class PlayedStoryboard:
    """All acts, until the stop trigger of the storyboard holds; then everybody brakes.

    Args:
        spec: the storyboard.
        movers: everybody who moves, by name.
        world: what conditions look at.
    """

    def __init__(self, spec: StoryboardSpec, movers: Dict[str, Mover], world: StoryState) -> None:
        self._movers = movers
        self._world = world
        self._acts = [PlayedAct(act, movers, world) for act in spec.acts]
        self._stop = Waiting(spec.stop, world)
        self._is_over = False

    def states(self) -> List[PartState]:
        """How each event stands, followed by its actions, in the order of the file."""
        return [state for act in self._acts for state in act.states()]

    def step(self, time_s: float) -> None:
        """Act on what the last step showed, and move everybody on by one.

        Args:
            time_s: of the last step.
        """
        if not self._is_over:
            self._world.look(time_s)
            for act in self._acts:
                act.finish()
            if self._stop.holds():
                self._end()
            else:
                for act in self._acts:
                    act.look()
        for mover in self._movers.values():
            mover.step()

    def _end(self) -> None:
        self._is_over = True
        _log.info("%.2f s: the storyboard is over; everybody stands", self._world.time_s)
        for act in self._acts:
            act.stop()
        for mover in self._movers.values():
            mover.brake()
