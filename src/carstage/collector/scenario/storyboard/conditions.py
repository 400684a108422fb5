"""Judges whether conditions hold."""

from __future__ import annotations

import math
from collections import deque
from typing import Callable, Deque, Dict, Optional, Set, Tuple

from carstage.collector.scenario.storyboard.places import Places
from carstage.collector.scenario.storyboard.road_users import (
    Body,
    RoadUsers,
    body_at,
    closing_m_s,
    distance_m,
)
from carstage.spec.storyboard import EUCLIDEAN, STATES, StoryCondition, Trigger

SAME = 1e-3
"""Measures that differ by less are equal."""
STANDBY, RUNNING, COMPLETE = STATES

PartKey = Tuple[str, str]
"""Type and name of a part of the storyboard."""


class StoryState:
    """What conditions look at.

    Args:
        users: everybody.
        places: the map's.
        step_s: simulated time of a step.

    Attributes:
        time_s: of the last step.
        states: of the storyboard's parts.
        transitions: of parts, since the conditions were judged before.
    """

    def __init__(self, users: RoadUsers, places: Places, step_s: float) -> None:
        self.users = users
        self.places = places
        self.step_s = step_s
        self.time_s = 0.0
        self.states: Dict[PartKey, str] = {}
        self.transitions: Set[Tuple[PartKey, str]] = set()
        self._next: Set[Tuple[PartKey, str]] = set()

    def look(self, time_s: float) -> None:
        """Take in the last step."""
        self.time_s = time_s
        self.users.look()
        self.transitions, self._next = self._next, set()

    def ended(self, part: PartKey, transition: str, state: str) -> None:
        """Note what ended by itself, before conditions are judged."""
        self.states[part] = state
        self.transitions.add((part, transition))

    def changed(self, part: PartKey, transition: str, state: str) -> None:
        """Note what conditions brought about; others see it in the next step."""
        self.states[part] = state
        self._next.add((part, transition))


class Condition:
    """One condition, judged once in each step in which its part waits.

    With an edge it holds in the step in which it comes to be fulfilled, or ceases to be. In the
    first step there is no step before, so it does not hold (ASAM OpenSCENARIO 1.2, 7.6.2).

    Args:
        spec: what has to hold.
        world: what it looks at.
    """

    def __init__(self, spec: StoryCondition, world: StoryState) -> None:
        self._spec = spec
        self._world = world
        self._before: Optional[bool] = None
        steps = round(spec.delay_s / world.step_s)
        self._held: Deque[bool] = deque([False] * steps, steps + 1)

    def holds(self) -> bool:
        """Whether it holds now."""
        now, before = self._is_fulfilled(), self._before
        self._before = now
        edge = self._spec.edge
        if edge != "none":
            rises, falls = before is False and now, before is True and not now
            now = (rises and edge != "falling") or (falls and edge != "rising")
        self._held.append(now)
        return self._held.popleft()

    def _is_fulfilled(self) -> bool:
        spec, world = self._spec, self._world
        if spec.kind == "time":
            return _compares(world.time_s, spec.rule, spec.value, 0.5 * world.step_s)
        if spec.element is not None:
            found = (spec.element, spec.state) in world.transitions
            return found or world.states.get(spec.element, STANDBY) == spec.state
        judged = [
            _compares(MEASURES[spec.kind](self, name), spec.rule, spec.value, SAME)
            for name in spec.entities
        ]
        return all(judged) if spec.every else any(judged)

    def _other(self) -> Body:
        spec, world = self._spec, self._world
        if spec.other is not None:
            return world.users.body(spec.other)
        assert spec.place is not None
        return body_at(world.places.transform(spec.place))

    def _distance_m(self, name: str) -> float:
        spec, body = self._spec, self._world.users.body(name)
        return distance_m(body, self._other(), spec.measure, spec.freespace)

    def _traveled_m(self, name: str) -> float:
        return self._world.users.traveled_m(name)

    def _still_s(self, name: str) -> float:
        return self._world.users.still_s(name)

    def _speed_m_s(self, name: str) -> float:
        return self._world.users.body(name).speed_m_s

    def _relative_speed_m_s(self, name: str) -> float:
        return self._speed_m_s(name) - self._other().speed_m_s

    def _ttc_s(self, name: str) -> float:
        closing = closing_m_s(self._world.users.body(name), self._other(), self._spec.measure)
        return self._distance_m(name) / closing if closing > SAME else math.inf

    def _headway_s(self, name: str) -> float:
        speed_m_s = self._speed_m_s(name)
        return self._distance_m(name) / speed_m_s if speed_m_s > SAME else math.inf

    def _off_place_m(self, name: str) -> float:
        return distance_m(self._world.users.body(name), self._other(), EUCLIDEAN, False)


MEASURES: Dict[str, Callable[[Condition, str], float]] = {
    "traveled": Condition._traveled_m,
    "reach": Condition._off_place_m,
    "distance": Condition._distance_m,
    "relative_distance": Condition._distance_m,
    "speed": Condition._speed_m_s,
    "relative_speed": Condition._relative_speed_m_s,
    "stand_still": Condition._still_s,
    "time_to_collision": Condition._ttc_s,
    "headway": Condition._headway_s,
}


class Waiting:
    """A trigger that is waited for.

    Args:
        spec: its groups of conditions.
        world: what they look at.
    """

    def __init__(self, spec: Trigger, world: StoryState) -> None:
        self._groups = [[Condition(each, world) for each in group] for group in spec]

    def holds(self) -> bool:
        """Whether all conditions of a group hold now; judges each of them."""
        held = [[condition.holds() for condition in group] for group in self._groups]
        return any(all(group) for group in held)


def _compares(value: float, rule: str, limit: float, same: float) -> bool:
    equal = abs(value - limit) < same
    if rule in ("equalTo", "notEqualTo"):
        return equal == (rule == "equalTo")
    if rule in ("lessOrEqual", "greaterOrEqual") and equal:
        return True
    if equal and rule in ("lessThan", "greaterThan"):
        return False
    return value < limit if rule.startswith("less") else value > limit
