"""Comfortable driving of one vehicle of the Traffic Manager, a step at a time."""

from __future__ import annotations

from math import isnan, sqrt
from typing import Any, List, NamedTuple, Optional, Sequence, Tuple

import carla

from carstage.collector.comfort.pedals import KMH_PER_M_S, Pedals, Sign
from carstage.collector.comfort.road import SPACING_M, Lane, RoadAhead, StopLines
from carstage.collector.comfort.road_users import RoadUser, RoadUsers
from carstage.collector.comfort.wishes import (
    CREEPING_M_S,
    HELD_M_S,
    on_free_road,
    to_be_slower,
    to_follow,
)
from carstage.collector.internals.dialect import coming_lanes
from carstage.spec import ComfortSpec

_LOOK_EVERY_S = 0.5
"""How often it is asked who is near, and which way the Traffic Manager takes."""
_MORE_AROUND_M = 15.0
"""Until it is asked again, one gets so much nearer to others and to signs."""
_MATTERS_M, _MATTERS_S = 20.0, 5.0
"""Who is ahead matters from a distance on when standing, and from farther when driving."""
_LANE_HALF_M = 1.6
_DETOUR = 1.6
"""A path is at most so many times as long as the distance, for who drives ahead on it."""
_CURVE_BEFORE_M = 2.0
_LIGHT_BEFORE_M = 2.0
"""CARLA's volumes before stop lines, in which the Traffic Manager stops, begin about there."""
_SIGN_BEFORE_M = 5.5
"""The Traffic Manager's points are 5 m apart: it may take a sign for passed as far before it."""
_MOST_BRAKING_M_S2 = 3.5
"""Who would have to brake harder for a yellow light goes on."""
_SIGN_S = 3.5
_HELD_MORE_M = 2.0
"""The Traffic Manager stops who is nearer to another than it shall be: that much."""
_STARTS_M_S2 = 0.3
"""Who is held is let go for such a wish."""
USUAL_DISTANCE_M = 2.0
"""CARLA's default of what the Traffic Manager keeps to who stands ahead."""
_AT_PLACE_M = 1.5
"""So near to where it is to stand, and as slow as who is held, it is asked for no speed at all."""
_DIGITS = 4
"""Of the percentage that is told: the last bits of what follows from the map may differ."""


class Streets(NamedTuple):
    """Where the vehicles of an episode drive.

    Attributes:
        manager: ``carla.TrafficManager``, synchronous; it drives the vehicles.
        world: ``carla.World``.
        map: ``carla.Map``.
        stop_lines: of the map's lights.
        users: of the world.
        step_s: simulated time of a step.
    """

    manager: Any
    world: Any
    map: Any
    stop_lines: StopLines
    users: RoadUsers
    step_s: float


class ComfortableDriving:
    """Tells the Traffic Manager how fast a vehicle should go.

    Args:
        streets: where it drives.
        vehicle: ``carla.Vehicle``.
        comfort: what is comfortable.
        slower_percent: than the speed limit, on a free road.
        distance_m: that the Traffic Manager keeps to who stands before the vehicle.
    """

    def __init__(
        self,
        streets: Streets,
        vehicle: Any,
        comfort: ComfortSpec,
        slower_percent: float = 0.0,
        distance_m: float = USUAL_DISTANCE_M,
    ) -> None:
        self._streets = streets
        self._vehicle = vehicle
        self._id = int(vehicle.id)
        self._half_m = float(vehicle.bounding_box.extent.x)
        self._comfort = comfort
        self._share = 1.0 - slower_percent / 100.0
        self._road = RoadAhead(streets.map, streets.stop_lines)
        self._pedals = Pedals(comfort, streets.step_s)
        self._look_every = max(1, round(_LOOK_EVERY_S / streets.step_s))
        self._steps = 0
        self._near: List[RoadUser] = []
        self._marks: List[Tuple[float, float, float]] = []
        self._chosen: Tuple[Lane, ...] = ()
        self._gap_m = 0.0
        self._holds = False
        self._distance_m = distance_m
        self._asked_m_s: Optional[float] = None
        self._asked_within_m = 0.0
        self._right_m = 0.0

    def ask(self, speed_m_s: Optional[float], within_m: float = 0.0) -> None:
        """Have it drive at most that fast from a place ahead on, until something else is asked.

        Args:
            speed_m_s: 0: it stands there; None: as fast as it likes.
            within_m: how far the place is ahead of its front.
        """
        self._asked_m_s, self._asked_within_m = speed_m_s, within_m

    def keep_aside(self, right_m: float) -> None:
        """Know that the Traffic Manager drives it so far to the right of its lane's middle."""
        self._right_m = right_m

    def before_step(self) -> None:
        """Tell it, ahead of a step; nothing where the vehicle is not there, or has no limit."""
        snapshot = self._streets.world.get_snapshot()
        state = snapshot.find(self._id)
        limit_kmh = self._vehicle.get_speed_limit()
        if state is None or limit_kmh <= 0.0:
            return
        velocity = state.get_velocity()
        here = self._in_lane(state.get_transform().location)
        looks = self._steps % self._look_every == 0
        self._steps += 1
        speed_m_s = sqrt(velocity.x * velocity.x + velocity.y * velocity.y)
        limit_m_s = self._share * limit_kmh / KMH_PER_M_S
        self._follow(here, looks)
        if looks:
            around_m = _matters_m(speed_m_s) + _MORE_AROUND_M
            self._near = self._streets.users.near(snapshot, here.x, here.y, around_m, self._id)
            self._marks = self._road.signs(_SIGN_S * limit_m_s + _MORE_AROUND_M)
        signs = self._signs(here, limit_m_s)
        wish_m_s2 = min(
            on_free_road(self._comfort, speed_m_s, limit_m_s),
            self._wish_by_road(speed_m_s),
            self._wish_by_signs(speed_m_s, signs),
            self._wish_by_others(snapshot, here, speed_m_s),
            self._wish_as_asked(speed_m_s),
        )
        signs = [sign for sign in signs if sign.distance_m > _SIGN_BEFORE_M]
        desired_m_s = self._pedals.desired_m_s(speed_m_s, wish_m_s2, self._pedal(), signs)
        if self._stands_as_asked(speed_m_s):
            desired_m_s = 0.0
        percent = 100.0 * (1.0 - desired_m_s * KMH_PER_M_S / limit_kmh)
        self._streets.manager.vehicle_percentage_speed_difference(
            self._vehicle, round(percent, _DIGITS)
        )

    def _pedal(self) -> float:
        """Throttle (above 0) or brake (below) of the last step; asked to stand, it has neither."""
        control = self._vehicle.get_control()
        pedal = float(control.throttle - control.brake)
        return 0.0 if isnan(pedal) else pedal

    def _in_lane(self, there: Any) -> Any:
        """A ``carla.Location`` as it were if the vehicle drove in the middle of its lane."""
        if self._right_m == 0.0 or not self._road.places:
            return there
        along_x, along_y = self._road.along(self._road.at)
        x, y = there.x + self._right_m * along_y, there.y - self._right_m * along_x
        return carla.Location(x, y, there.z)

    def _follow(self, here: Any, looks: bool) -> None:
        """Know the road ahead."""
        anew = not self._road.follow(here.x, here.y) and self._right_m == 0.0
        anew = anew or not self._road.places
        if anew:
            self._road.begin(here)
        if anew or (looks and self._road.forks):
            self._chosen = coming_lanes(self._streets.manager, self._vehicle)
        if anew or looks or not self._road.forks:
            self._road.reach(self._chosen)

    def _signs(self, here: Any, limit_m_s: float) -> List[Sign]:
        """Signs ahead that mean less than the limit."""
        along_x, along_y = self._road.along(self._road.at)
        found = []
        for x, y, speed_m_s in self._marks:
            dx, dy = x - here.x, y - here.y
            if speed_m_s < limit_m_s and dx * along_x + dy * along_y > 0.0:
                found.append(Sign(sqrt(dx * dx + dy * dy), speed_m_s))
        return found

    def _wish_by_road(self, speed_m_s: float) -> float:
        """What curves and lights ask for."""
        comfort, road = self._comfort, self._road
        wish = comfort.acceleration_m_s2
        reach_m = speed_m_s * speed_m_s / (2.0 * comfort.acceleration_m_s2) + 2.0 * speed_m_s + 10.0
        for number in road.bends_and_lights(reach_m):
            place = road.places[number]
            if place.curvature > 0.0:
                there_m_s = sqrt(comfort.lateral_m_s2 / place.curvature)
                before_m = max(road.distance_m(number) - _CURVE_BEFORE_M, 0.0)
                wish = min(wish, to_be_slower(comfort, speed_m_s, there_m_s, before_m))
            if place.light is not None and number >= road.at:
                stop_m = road.distance_m(number) - self._half_m
                if _stops(place.light.get_state(), speed_m_s, stop_m):
                    before_m = max(stop_m - _LIGHT_BEFORE_M, 0.0)
                    wish = min(wish, to_be_slower(comfort, speed_m_s, CREEPING_M_S, before_m))
        return wish

    def _wish_by_signs(self, speed_m_s: float, signs: Sequence[Sign]) -> float:
        """What signs ask for, so that the Traffic Manager need not brake for them by itself."""
        wish = self._comfort.acceleration_m_s2
        for sign in signs:
            before_m = max(sign.distance_m - _SIGN_BEFORE_M, 0.0)
            wish = min(wish, to_be_slower(self._comfort, speed_m_s, sign.speed_m_s, before_m))
        return wish

    def _wish_by_others(self, snapshot: Any, here: Any, speed_m_s: float) -> float:
        """What others on the road ahead ask for."""
        road, wish = self._road, self._comfort.acceleration_m_s2
        matters_m = _matters_m(speed_m_s)
        ahead_x, ahead_y = road.along(road.at)
        for user in self._near:
            state = snapshot.find(user.id)
            if state is None:
                continue
            there = self._in_lane(state.get_transform().location)
            dx, dy = there.x - here.x, there.y - here.y
            far_m = sqrt(dx * dx + dy * dy)
            if far_m > matters_m or dx * ahead_x + dy * ahead_y < 0.0:
                continue
            last = min(len(road.places), road.at + 2 + int(_DETOUR * far_m / SPACING_M))
            beside_m, number = road.nearest(there.x, there.y, road.at, last)
            if beside_m > _LANE_HALF_M or number == road.at:
                continue
            along, velocity = road.along(number), state.get_velocity()
            other_m_s = max(velocity.x * along[0] + velocity.y * along[1], 0.0)
            gap_m = road.gap_m(there.x, there.y, number) - self._half_m - user.half_m
            following = to_follow(self._comfort, speed_m_s, other_m_s, gap_m)
            if following < wish:
                wish, self._gap_m = following, gap_m
        self._hold(wish, speed_m_s)
        return wish

    def _wish_as_asked(self, speed_m_s: float) -> float:
        """What :meth:`ask` was told; the step that comes is not in that yet."""
        if self._asked_m_s is None:
            return self._comfort.acceleration_m_s2
        self._asked_within_m -= speed_m_s * self._streets.step_s
        there_m_s, before_m = self._asked_m_s, max(self._asked_within_m, 0.0)
        return to_be_slower(self._comfort, speed_m_s, there_m_s, before_m)

    def _stands_as_asked(self, speed_m_s: float) -> bool:
        """Whether it is to stand here. Of no speed the Traffic Manager makes no pedals at all."""
        arrives = self._asked_within_m < _AT_PLACE_M and speed_m_s < HELD_M_S
        return self._asked_m_s == 0.0 and arrives

    def _hold(self, wish_m_s2: float, speed_m_s: float) -> None:
        """Have the Traffic Manager hold who stands behind another, and let it go again."""
        if not self._holds and wish_m_s2 < 0.0 and speed_m_s < HELD_M_S:
            self._holds = True
            distance_m = self._gap_m + _HELD_MORE_M
        elif self._holds and wish_m_s2 > _STARTS_M_S2:
            self._holds = False
            distance_m = self._distance_m
        else:
            return
        self._streets.manager.distance_to_leading_vehicle(self._vehicle, distance_m)


def _matters_m(speed_m_s: float) -> float:
    """Who is farther ahead does not matter yet."""
    return _MATTERS_M + _MATTERS_S * speed_m_s


def _stops(state: Any, speed_m_s: float, stop_m: float) -> bool:
    """Whether a light stops who can still stop comfortably."""
    if state == carla.TrafficLightState.Red:
        return True
    if state != carla.TrafficLightState.Yellow:
        return False
    return speed_m_s * speed_m_s <= 2.0 * _MOST_BRAKING_M_S2 * max(stop_m, 0.0)
