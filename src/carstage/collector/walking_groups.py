"""People who walk together: one leads, the others keep beside.

CARLA's navigation leads everybody alone, from corner to corner of a way. Two with one goal would
soon walk one behind the other. So who goes with another is sent to a place beside where that one
will be, and made a little faster or slower. Over a road each is sent once, to the other side: whom
CARLA gives a new way there stops to look again.
"""

from __future__ import annotations

import math
from typing import Any, Dict, NamedTuple, Optional, Sequence, Set

import carla

from carstage.collector.actors import Walker
from carstage.collector.crosswalks import Crosswalk
from carstage.collector.pedestrian_rules import PedestrianRules
from carstage.collector.world import WorldSession

ASIDE_M = 0.4
"""From a leader's way to the place beside it; CARLA's navigation keeps them farther apart."""
AHEAD_S = 2.5
EVERY_S = 0.5
"""Between two looks at where the leader is."""
STANDS_M_S = 0.3
WAITS_M = 1.3
"""Who is that near to a leader that stands, stands too."""
LOST_M = 20.0
"""Who is farther away goes its own way."""
OVER_M, BEYOND_M = 0.3, 2.0
"""Beyond the end of a crosswalk: who is there is over it, and where who crosses is sent to."""
CATCH_UP = 0.35
"""So much faster, as a share, for each metre behind; slower for each ahead."""
MOST_CHANGE = 0.4


class _Over(NamedTuple):
    """A way over a crosswalk: towards its positive or negative end, and where it leads to."""

    crosswalk: Crosswalk
    side: float
    goal: Any


class WalkingGroups:
    """Keeps those who go with somebody beside that one.

    Args:
        session: the episode's world.
        walkers: all that CARLA's navigation leads.
        step_s: simulated time of a step.
        rules: keep walkers at kerbs.
    """

    def __init__(
        self,
        session: WorldSession,
        walkers: Sequence[Walker],
        step_s: float,
        rules: PedestrianRules,
    ) -> None:
        self._world = session.world
        known = {walker.actor.id for walker in walkers}
        self._followers = [walker for walker in walkers if walker.leader in known]
        self._rules = rules
        self._sides: Dict[int, float] = {}
        self._over: Dict[int, _Over] = {}
        self._were_held: Set[int] = set()
        self._every = max(round(EVERY_S / step_s), 1)
        self._steps = 0

    def before_step(self) -> None:
        """Called ahead of each step, after those at kerbs were stopped or let go."""
        self._steps += 1
        if not self._followers or self._steps % self._every:
            return
        snapshot = self._world.get_snapshot()
        for walker in self._followers:
            leader, own = snapshot.find(walker.leader), snapshot.find(walker.actor.id)
            if self._rules.holds(walker.actor.id):
                self._were_held.add(walker.actor.id)
            elif leader is not None and own is not None:
                there, velocity = leader.get_transform().location, leader.get_velocity()
                here = own.get_transform().location
                if not self._crosses(walker, there, velocity, here):
                    self._keep_beside(walker, there, velocity, here)
                self._were_held.discard(walker.actor.id)

    def _crosses(self, walker: Walker, there: Any, velocity: Any, here: Any) -> bool:
        """Send who follows over the crosswalk that the leader enters; whether it is on that way."""
        number, over = walker.actor.id, self._over.get(walker.actor.id)
        if over is None:
            over = self._way_over(there, velocity, here)
            if over is None:
                return False
            self._over[number] = over
        elif over.side * over.crosswalk.own(here.x, here.y)[0] > over.crosswalk.half_m + OVER_M:
            del self._over[number]
            return False
        elif number not in self._were_held:
            return True
        walker.controller.go_to_location(over.goal)
        walker.controller.set_max_speed(walker.speed_m_s)
        return True

    def _way_over(self, there: Any, velocity: Any, here: Any) -> Optional[_Over]:
        """The way over a crosswalk on which a leader goes, for somebody who is not over it yet."""
        crosswalk = self._rules.crosswalk_at(there)
        if crosswalk is None:
            return None
        over_m_s, along_m_s = crosswalk.turned(velocity.x, velocity.y)
        side = math.copysign(1.0, over_m_s)
        leads_m, _ = crosswalk.own(there.x, there.y)
        over_m, along_m = crosswalk.own(here.x, here.y)
        if abs(over_m_s) < max(abs(along_m_s), STANDS_M_S):
            return None
        if side * leads_m > crosswalk.half_m or side * over_m > crosswalk.half_m:
            return None
        goal_m = side * (crosswalk.half_m + BEYOND_M)
        aside_m = min(max(along_m, -crosswalk.half_width_m), crosswalk.half_width_m)
        (x, y), (across_x, across_y) = crosswalk.middle, crosswalk.across
        goal = carla.Location(
            x + goal_m * across_x - aside_m * across_y,
            y + goal_m * across_y + aside_m * across_x,
            there.z,
        )
        return _Over(crosswalk, side, goal)

    def _keep_beside(self, walker: Walker, there: Any, velocity: Any, here: Any) -> None:
        x, y = here.x - there.x, here.y - there.y
        speed = math.hypot(velocity.x, velocity.y)
        if math.hypot(x, y) > LOST_M:
            walker.controller.set_max_speed(walker.speed_m_s)
            return
        if speed < STANDS_M_S:
            near = math.hypot(x, y) < WAITS_M
            walker.controller.set_max_speed(0.0 if near else walker.speed_m_s)
            if not near:
                walker.controller.go_to_location(there)
            return
        ahead = (velocity.x / speed, velocity.y / speed)
        before_m, aside_m = x * ahead[0] + y * ahead[1], y * ahead[0] - x * ahead[1]
        side = self._side(walker, aside_m)
        on_m = AHEAD_S * speed
        walker.controller.go_to_location(
            carla.Location(
                there.x + on_m * ahead[0] - side * ASIDE_M * ahead[1],
                there.y + on_m * ahead[1] + side * ASIDE_M * ahead[0],
                there.z,
            )
        )
        change = min(max(-CATCH_UP * before_m, -MOST_CHANGE), MOST_CHANGE)
        walker.controller.set_max_speed(walker.speed_m_s * (1.0 + change))

    def _side(self, walker: Walker, aside_m: float) -> float:
        """1 right or -1 left of the leader: where it is at first, and each of two has its own."""
        if walker.actor.id not in self._sides:
            taken = [
                self._sides[other.actor.id]
                for other in self._followers
                if other.leader == walker.leader and other.actor.id in self._sides
            ]
            self._sides[walker.actor.id] = -taken[0] if taken else math.copysign(1.0, aside_m)
        return self._sides[walker.actor.id]
