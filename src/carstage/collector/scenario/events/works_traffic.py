"""How vehicles of the Traffic Manager get past works, which it does not see.

CARLA's Traffic Manager looks at vehicles, walkers and signals, not at props. So programs with works
tell it how far from the middle of their lanes vehicles drive there, and how fast.
"""

from __future__ import annotations

import math
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

from carstage.collector.scenario.events.surroundings import (
    SPACING_M,
    Seen,
    Stretch,
    Surroundings,
    look_at,
)

BEFORE_M = 20.0
"""So far before the first cone vehicles begin to move over, and stop where they have to wait."""
OVER_M_S = 1.6
"""How fast they move over at most."""
OVER_SHARE = 0.35
"""Of their speed at most, so that nobody moves sideways only."""
BRAKE_M_S2 = 2.5
"""How hard they are asked to brake."""
AT_LINE_M, AT_REST_M_S = 0.5, 0.3
"""So near to where they wait, and so slow, they are asked for no speed at all."""
SLOWEST_M_S = 0.1
"""The least that is asked of who still rolls. The Traffic Manager divides by the speed that it is
asked for; of none it makes NaN, and the pedals come up."""
ON_LANE_M = 2.4
"""A vehicle that near to the middle of the lane drives in it, unless it is moving over."""
BEHIND_M = 20.0
"""So far behind the ego nobody may be in the lane beside, as it moves over."""
BACK_M = 0.1
"""So near to the middle of its lane the ego is back."""

Limit = Tuple[float, float]
"""A speed (m/s), and how far ahead it is to be driven (m)."""


class Works(NamedTuple):
    """Works in the ego's lane.

    ``first_m``, ``last_m``: the first and the last cone, along the stretch. ``over_m``: so far to
    the right of the lane's middle they are passed. ``speed_m_s``: so fast at most. ``closes``: the
    lane beside is needed. ``beside``: places of it, a metre apart from the begin of the stretch.
    ``oncoming``: it leads against the ego.
    """

    first_m: float
    last_m: float
    over_m: float
    speed_m_s: float
    closes: bool = False
    beside: Sequence[Tuple[float, float]] = ()
    oncoming: bool = False


class WorksTraffic:
    """Steers the ego past works; others too where the lane is wide enough, else they wait.

    Args:
        world: around the ego.
        stretch: of road, from before the works to behind them.
        works: what stands there.
    """

    def __init__(self, world: Surroundings, stretch: Stretch, works: Works) -> None:
        self._world = world
        self._works = works
        self._spots = [
            (place.transform.location.x, place.transform.location.y, place.transform.rotation.yaw)
            for place in stretch.places
        ]
        self._over_m: Dict[int, float] = {}
        self._limits: Dict[int, Limit] = {}
        self._vehicles: Dict[int, Any] = {}
        self._goes = not works.closes

    def step(self) -> None:
        """Tell the Traffic Manager what each vehicle near the works does next."""
        self._steer(look_at(self._world.ego), self._ego_goes)
        for vehicle in self._world.others():
            self._steer(vehicle, self._other_goes)

    def ego_is_past(self, behind_m: float) -> bool:
        """Whether the last cone is so far behind the ego's rear, and it is back in its lane."""
        along_m = self._along_m(look_at(self._world.ego))
        past = along_m is None or along_m - self._world.ego_half_m > self._works.last_m + behind_m
        return past and abs(self._over_m.get(self._world.ego.id, 0.0)) < BACK_M

    def release(self) -> None:
        """Everybody drives as before; who does so already may heed other works by now."""
        for vehicle in self._vehicles.values():
            if self._world.is_gone(vehicle):
                continue
            if self._over_m.get(vehicle.id, 0.0) != 0.0:
                self._world.shift(vehicle, 0.0)
            if vehicle.id in self._limits:
                self._world.limit_speed(vehicle, None)

    def _steer(self, one: Seen, goes: Any) -> None:
        works, vehicle, speed_m_s = self._works, one.actor, one.speed_m_s
        along_m = self._along_m(one)
        wanted_m: float = 0.0
        limit: Optional[Limit] = None
        half_m = float(vehicle.bounding_box.extent.x)
        if along_m is not None and along_m - half_m < works.last_m + 1.0:
            ahead_m = works.first_m - BEFORE_M - along_m - half_m
            near = ahead_m < _braking_m(speed_m_s, 0.0) + speed_m_s
            waits = near and not goes(along_m)
            if self._world.is_gentle(vehicle):
                limit = (0.0 if waits else works.speed_m_s), ahead_m
            else:
                limit = self._at_once(ahead_m, speed_m_s, waits)
            if goes(along_m) and ahead_m < 0.0:
                wanted_m = works.over_m
        elif self._over_m.get(vehicle.id, 0.0) != 0.0:
            limit = works.speed_m_s, 0.0
        if vehicle.id not in self._vehicles and wanted_m == 0.0 and limit is None:
            return
        self._vehicles[vehicle.id] = vehicle
        self._shift(vehicle, wanted_m, speed_m_s)
        if self._limits.get(vehicle.id) == limit:
            return
        if limit is None:
            self._world.limit_speed(vehicle, None)
            del self._limits[vehicle.id]
        else:
            self._world.limit_speed(vehicle, *limit)
            self._limits[vehicle.id] = limit

    def _at_once(self, ahead_m: float, speed_m_s: float, waits: bool) -> Optional[Limit]:
        """What to ask now of a vehicle that heeds it at once."""
        works_m_s = self._works.speed_m_s
        if waits:
            return _waiting_m_s(ahead_m, speed_m_s, works_m_s), 0.0
        return (works_m_s, 0.0) if ahead_m < _braking_m(speed_m_s, works_m_s) else None

    def _shift(self, vehicle: Any, wanted_m: float, speed_m_s: float) -> None:
        now_m = self._over_m.get(vehicle.id, 0.0)
        if now_m == wanted_m:
            return
        most_m = min(OVER_M_S, OVER_SHARE * speed_m_s) * self._world.step_s
        now_m += min(max(wanted_m - now_m, -most_m), most_m)
        self._over_m[vehicle.id] = now_m
        self._world.shift(vehicle, now_m)

    def _ego_goes(self, along_m: float) -> bool:
        """Whether the ego may pass: once it does, it does not stop again."""
        if not self._goes:
            begin_m = along_m - (0.0 if self._works.oncoming else BEHIND_M)
            spots = self._works.beside[max(round(begin_m / SPACING_M), 0) :]
            near = along_m > self._works.first_m - BEFORE_M - BEHIND_M
            self._goes = near and self._world.first_taken(spots) is None
        return self._goes

    def _other_goes(self, along_m: float) -> bool:
        del along_m
        return not self._works.closes

    def _along_m(self, one: Seen) -> Optional[float]:
        """How far along the stretch a vehicle is; None where it is not on it."""
        at = one.transform.location
        away: List[float] = [math.hypot(at.x - x, at.y - y) for x, y, _ in self._spots]
        nearest = min(range(len(away)), key=away.__getitem__)
        aside_m = ON_LANE_M + abs(self._over_m.get(one.actor.id, 0.0))
        turned = one.transform.rotation.yaw - self._spots[nearest][2]
        same_way = abs((turned + 180.0) % 360.0 - 180.0) < 60.0
        if away[nearest] > aside_m or not same_way:
            return None
        return nearest * SPACING_M


def _waiting_m_s(ahead_m: float, speed_m_s: float, most_m_s: float) -> float:
    """What to ask of a vehicle that waits ``ahead_m`` further on; never to speed up beyond most."""
    if ahead_m < AT_LINE_M and speed_m_s < AT_REST_M_S:
        return 0.0
    stopping_m_s = math.sqrt(2.0 * BRAKE_M_S2 * max(ahead_m, 0.0))
    return max(min(stopping_m_s, max(speed_m_s, most_m_s)), SLOWEST_M_S)


def _braking_m(speed_m_s: float, then_m_s: float) -> float:
    """The way in which a vehicle comes from one speed to another."""
    return max(speed_m_s**2 - then_m_s**2, 0.0) / (2.0 * BRAKE_M_S2)
