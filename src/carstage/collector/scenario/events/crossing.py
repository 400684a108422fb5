"""Event ``pedestrian_crosses``."""

from __future__ import annotations

import math
from typing import Any, Optional

import carla

from carstage.collector.scenario.events.base import Event, event
from carstage.collector.scenario.events.lanes import MOST_LANES, lane_beside
from carstage.collector.scenario.events.leader import ROOM_M
from carstage.collector.scenario.events.surroundings import LANE_HALF_M

KERB_M = 0.8
"""So far beyond the road's edge a pedestrian waits, and stops again."""
CAR_CLEAR_M = 0.15
"""Between the edge of the road and a parked car."""
CAR_HALF_M = 3.0
"""Half the length of the longest car."""
BEFORE_CAR_M = 1.0
"""Between the front of a parked car and the pedestrian behind it."""
WALKER_Z_M = 1.0
LEAST_M_S = 2.0
"""An ego that is slower waits for something else."""
STUCK_S = 1.5
STUCK_M = 0.3
"""Who has not come that far in that time stands before something."""


@event("pedestrian_crosses")
class PedestrianCrosses(Event):
    """A pedestrian steps out when the ego is near, and walks straight to the other side."""

    _walker: Any
    _start: Any
    _towards: Any
    _width_m = 0.0
    _crossing: Any
    _came_m = 0.0
    _came_s = 0.0

    def place(self) -> Optional[str]:
        """At the kerb beside the road ahead; behind a parked car where that is asked for."""
        world, spec = self.world, self.spec
        stretch = world.stretch(spec.distance_m + ROOM_M)
        if not stretch.places:
            return "the ego was in a junction"
        if stretch.length_m < spec.distance_m + ROOM_M:
            return "the road ahead had no %.0f m without a junction" % (spec.distance_m + ROOM_M)
        place = stretch.at(spec.distance_m)
        if world.is_taken([place], 2.0 * LANE_HALF_M):
            return "another vehicle was where the pedestrian was to cross"
        side = 1.0 if spec.side == "right" else -1.0
        near_m, far_m = _edge_m(place, spec.side), _edge_m(place, _other(spec.side))
        wait_m, back_m = near_m + KERB_M, 0.0
        if spec.parked_car:
            car = self._park(place, near_m, side)
            if car is None:
                return "there was no room for a parked car beside the road"
            extent = car.bounding_box.extent
            wait_m = near_m + CAR_CLEAR_M + float(extent.y)
            back_m = CAR_HALF_M - float(extent.x)
        return self._stand(_behind(place.transform, back_m), side, wait_m, far_m)

    def wait(self) -> Optional[str]:
        """Stand until the ego is near."""
        ahead_m, _ = self.world.from_ego(self._crossing)
        if ahead_m < 0.0 or ahead_m > self.spec.distance_m + ROOM_M:
            return "the ego stopped short of it, or took another way"
        near = ahead_m - self.world.step_m <= self.spec.trigger_m
        if near and self.world.ego_speed_m_s >= LEAST_M_S:
            self.begin()
            self._came_m = self._came_s = 0.0
            self._walk(self.spec.speed_m_s)
        return None

    def run(self) -> bool:
        """Walk on until the other side, or until something near it is in the way."""
        at = self._walker.get_location()
        walked_m = (at.x - self._start.x) * self._towards.x
        walked_m += (at.y - self._start.y) * self._towards.y
        if self.elapsed_s > STUCK_S and walked_m < STUCK_M:
            self.give_up("something stood in the pedestrian's way")
            return True
        if walked_m > self._came_m + STUCK_M:
            self._came_m, self._came_s = walked_m, self.elapsed_s
        stands = self.elapsed_s > self._came_s + STUCK_S + STUCK_M / self.spec.speed_m_s
        arrives = walked_m > self._width_m - 2.0 * KERB_M
        longest_s = 3.0 * self._width_m / self.spec.speed_m_s
        goes_on = self.elapsed_s < longest_s and not (stands and arrives)
        if walked_m < self._width_m and goes_on:
            self._walk(self.spec.speed_m_s)
            return True
        self._walk(0.0)
        return False

    def _park(self, place: Any, near_m: float, side: float) -> Optional[Any]:
        """Park a car beside the road so that the longest one ends before the place."""
        blueprint = self.world.draw_car()
        if blueprint is None:
            return None
        aside_m = side * (near_m + 1.0 + CAR_CLEAR_M)
        spot = _behind(place.transform, CAR_HALF_M + BEFORE_CAR_M, aside_m)
        car = self.world.spawn(blueprint, spot)
        if car is None:
            return None
        self.actors.append(car)
        brake = carla.VehicleControl(brake=1.0, hand_brake=True)
        self.world.commands.append(carla.command.ApplyVehicleControl(car.id, brake))
        self.world.light(car)
        return car

    def _stand(self, transform: Any, side: float, wait_m: float, far_m: float) -> Optional[str]:
        blueprint = self.world.draw("walker.pedestrian.*", age="adult")
        if blueprint is None:
            return "the server has no blueprint of a pedestrian"
        self._crossing = transform.location
        yaw = math.radians(transform.rotation.yaw)
        right = carla.Vector3D(-math.sin(yaw), math.cos(yaw), 0.0)
        self._towards = carla.Vector3D(-side * right.x, -side * right.y, 0.0)
        self._width_m = wait_m + far_m + KERB_M
        self._start = carla.Location(
            transform.location.x + side * wait_m * right.x,
            transform.location.y + side * wait_m * right.y,
            transform.location.z + WALKER_Z_M,
        )
        facing = transform.rotation.yaw - 90.0 * side
        spot = carla.Transform(self._start, carla.Rotation(0.0, facing, 0.0))
        walker = self.world.spawn(blueprint, spot)
        if walker is None:
            return "there was no room for a pedestrian beside the road"
        self._walker = walker
        self.actors.insert(0, walker)
        return None

    def _walk(self, speed_m_s: float) -> None:
        control = carla.WalkerControl(self._towards, speed_m_s, False)
        self.world.commands.append(carla.command.ApplyWalkerControl(self._walker.id, control))


def _behind(transform: Any, back_m: float, right_m: float = 0.0) -> Any:
    """A ``carla.Transform`` so far behind and to the right of another, with its heading."""
    at, yaw = transform.location, math.radians(transform.rotation.yaw)
    x = at.x - back_m * math.cos(yaw) - right_m * math.sin(yaw)
    y = at.y - back_m * math.sin(yaw) + right_m * math.cos(yaw)
    return carla.Transform(
        carla.Location(x, y, at.z), carla.Rotation(0.0, transform.rotation.yaw, 0.0)
    )


def _other(side: str) -> str:
    return "left" if side == "right" else "right"


def _edge_m(place: Any, side: str) -> float:
    """From the middle of a lane to where the road ends on a side: its sidewalk begins there."""
    edge_m = 0.5 * place.lane_width
    lane = lane_beside(place, side, place)
    for _ in range(MOST_LANES):
        if lane is None or lane.lane_type == carla.LaneType.Sidewalk:
            break
        edge_m += lane.lane_width
        lane = lane_beside(lane, side, place)
    return float(edge_m)
