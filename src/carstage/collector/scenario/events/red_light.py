"""Event ``red_light_runner``."""

from __future__ import annotations

import math
from typing import Any, List, NamedTuple, Optional, Tuple

import carla

from carstage.collector.scenario.events.base import Event, event
from carstage.collector.scenario.events.cars import DrivenCar, LaneLine, straightest
from carstage.collector.scenario.events.leader import LEAST_M_S
from carstage.collector.scenario.events.signals import HeldSignals
from carstage.collector.scenario.events.surroundings import SPACING_M, Stretch

EARLY_M, LATE_M = 6.0, 3.0
"""So much before and behind the place that is asked for the car may appear: a place is not looked
for in each step."""
SIGNAL_M = 20
"""So far before a junction its lights stand at most."""
SIGNAL_TYPE = "1000001"
"""Of a traffic light in OpenDRIVE files, as CARLA's maps have them."""
CROSS_DEG = (50.0, 130.0)
"""Between both ways where they cross."""
STRAIGHT_DEG = 30.0
"""A way through a junction that turns by less is straight."""
MEET_M = 1.5
"""Two ways that come that near cross."""
WAY_M = 60
"""The longest way through a junction."""
BEYOND_M = 5.0
"""So far beyond the junction it is over."""
CLEAR_M = 10.0
"""So far beyond the junction nobody may stand in its way."""
LEAST_S, LEAST_M = 0.5, 5.0
"""It appears that long before both ways cross, and that far from the junction, at least."""
NEARLY = 0.95
"""It enters the junction with that share of its speed, at least."""
NEAR_WAY_M = 12.0
"""Nobody else drives so near to its way through the junction, as it enters."""
PATIENCE_S = 10.0
"""It has as much longer than it takes by itself."""


class Crossing(NamedTuple):
    """A way through a junction that crosses the ego's.

    ``approach``: waypoints before the junction, the nearest first. ``way``: those in it.
    ``cross_m``: along ``way`` to where both cross. ``ego_m``: along the ego's way to there.
    """

    approach: List[Any]
    way: List[Any]
    cross_m: float
    ego_m: float


@event("red_light_runner")
class RedLightRunner(Event):
    """A car comes from the side and does not stop; the junction's lights are held meanwhile."""

    _car: DrivenCar
    _signals: Optional[HeldSignals] = None
    _way: List[Any]
    _enters_m = 0.0
    _leaves_m = 0.0
    _longest_s = 0.0

    @classmethod
    def lacking(cls, world_map: Any) -> Optional[str]:
        """Traffic lights."""
        if world_map.get_all_landmarks_of_type(SIGNAL_TYPE):
            return None
        return "no junction with traffic lights"

    def place(self) -> Optional[str]:
        """On a road that crosses the ego's at the junction ahead, as far away as fits."""
        world, spec = self.world, self.spec
        if world.ego_speed_m_s < LEAST_M_S:
            return "the ego was too slow to reach a junction soon"
        stretch = world.stretch(spec.trigger_m + EARLY_M)
        to_junction_m = stretch.length_m - world.ego_half_m
        if not stretch.places or not stretch.ends_at_junction:
            return "no junction was near enough ahead"
        if to_junction_m < spec.trigger_m - LATE_M:
            return "the ego was too near to the junction ahead"
        if world.is_taken(stretch.places):
            return "another vehicle was ahead of the ego"
        own = world.signals_after(stretch.places[max(len(stretch.places) - SIGNAL_M, 0)], SIGNAL_M)
        if not own:
            return "the junction ahead had no traffic lights"
        blueprint = world.draw_car()
        if blueprint is None:
            return "the server has no blueprint of a car"
        reason = "no road crossed the ego's straight on at the junction ahead"
        for crossing in _crossings(stretch):
            reason = self._enter_by(crossing, blueprint, own)
            if not reason:
                return None
        return reason

    def wait(self) -> Optional[str]:
        """Drive on; it begins as the car enters the junction."""
        self._car.drive(self.spec.speed_m_s)
        if self.elapsed_s > self._longest_s:
            return "the car was held up before the junction"
        if self._car.along_m + self._car.half_m >= self._enters_m:
            if not self._can_cross():
                return "another vehicle was in the car's way"
            self.begin()
        return None

    def run(self) -> bool:
        """Across, and out of the junction."""
        self._car.drive(self.spec.speed_m_s)
        leaves = self._car.along_m - self._car.half_m - BEYOND_M > self._leaves_m
        return not leaves and self.elapsed_s < self._longest_s

    def release(self) -> None:
        """The car becomes ordinary traffic, the lights go on by themselves."""
        self._car.hand_over()
        self.removed()

    def removed(self) -> None:
        """The lights go on by themselves."""
        if self._signals is not None:
            self._signals.release()
            self._signals = None

    def _can_cross(self) -> bool:
        """Whether it drives as fast as it is to, and will have to brake for nobody."""
        if self._car.is_held_up or self._car.speed_m_s < NEARLY * self.spec.speed_m_s:
            return False
        return not self.world.is_crossed(self._way, NEAR_WAY_M, self._car.actor)

    def _enter_by(self, crossing: Crossing, blueprint: Any, own: List[Any]) -> str:
        """Have the car come by a way; else tell why not."""
        world, spec = self.world, self.spec
        ego_s = crossing.ego_m / world.ego_speed_m_s
        cross_s = max(ego_s - spec.before_s, LEAST_S)
        back_m = max(spec.speed_m_s * cross_s - crossing.cross_m, LEAST_M)
        back = math.ceil(back_m / SPACING_M) + 1
        approach = crossing.approach[:back]
        if len(approach) < back:
            return "the road that crosses was too short"
        beyond = LaneLine(crossing.way[-1])
        spots = [beyond.pose(each)[:2] for each in range(1, round(CLEAR_M))]
        if world.is_taken([*approach, *crossing.way]) or world.first_taken(spots) is not None:
            return "another vehicle was on the road that crosses"
        others = world.signals_after(crossing.approach[:SIGNAL_M][-1], SIGNAL_M)
        group = own[0].get_group_traffic_lights()
        greens = {light.id for light in own}
        if not others or any(light.id in greens for light in others):
            return "the road that crosses had no traffic lights of its own"
        self._way = crossing.way
        line = LaneLine(approach[-1], [*approach[-2::-1], *crossing.way])
        self._enters_m = back * SPACING_M
        self._leaves_m = self._enters_m + len(crossing.way) * SPACING_M
        along_m = self._enters_m - back_m
        x, y, z, _, yaw = line.pose(along_m)
        actor = world.spawn(blueprint, world.transform(x, y, z, yaw))
        if actor is None:
            return "there was no room for a car on the road that crosses"
        self.actors = [actor]
        self._car = DrivenCar(world, actor, line, along_m, spec.speed_m_s)
        self._signals = world.hold_signals(own, group)
        self._longest_s = back_m / spec.speed_m_s + PATIENCE_S
        return ""


def _crossings(stretch: Stretch) -> List[Crossing]:
    """Ways through the junction ahead that cross a way of the ego's, the straightest way first."""
    last = stretch.places[-1]
    entries = [place for place in last.next(SPACING_M) if place.is_junction]
    if not entries:
        return []
    first = straightest(entries, last)
    ego_ways = [_way(one) for one in (first, *(one for one in entries if one is not first))]
    found = []
    for begin, end in first.get_junction().get_waypoints(carla.LaneType.Driving):
        angle = _angle(begin, last)
        if not CROSS_DEG[0] < angle < CROSS_DEG[1] or _angle(end, begin) > STRAIGHT_DEG:
            continue
        way = _way(begin)
        for rank, ego_way in enumerate(ego_ways):
            met = _meeting(way, ego_way)
            if met is not None:
                to_way_m = stretch.length_m + SPACING_M
                found.append((rank, Crossing(_approach(begin), way, met[0], to_way_m + met[1])))
                break
    return [crossing for _, crossing in sorted(found, key=lambda one: one[0])]


def _way(begin: Any) -> List[Any]:
    """Waypoints a metre apart from the begin of a way through a junction to its end."""
    way = [begin]
    while len(way) < WAY_M:
        following = way[-1].next(SPACING_M)
        if not following:
            break
        place = straightest(following, way[-1])
        if not place.is_junction:
            break
        way.append(place)
    return way


def _approach(begin: Any) -> List[Any]:
    """Waypoints before a junction, the nearest first, up to the junction before."""
    places: List[Any] = []
    before = begin.previous(SPACING_M)
    while before:
        place = straightest(before, places[-1] if places else begin)
        if place.is_junction:
            break
        places.append(place)
        before = place.previous(SPACING_M)
    return places


def _meeting(way: List[Any], other: List[Any]) -> Optional[Tuple[float, float]]:
    """How far along each of two ways they are nearest, if they come near."""
    spots = [place.transform.location for place in way]
    others = [place.transform.location for place in other]
    nearest = min(
        (math.hypot(a.x - b.x, a.y - b.y), i, j)
        for i, a in enumerate(spots)
        for j, b in enumerate(others)
    )
    if nearest[0] > MEET_M:
        return None
    return nearest[1] * SPACING_M, nearest[2] * SPACING_M


def _angle(one: Any, other: Any) -> float:
    turn = float(one.transform.rotation.yaw - other.transform.rotation.yaw)
    return abs((turn + 180.0) % 360.0 - 180.0)
