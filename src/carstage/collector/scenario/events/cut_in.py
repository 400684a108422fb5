"""Event ``cut_in``."""

from __future__ import annotations

import math
from typing import Any, List, Optional, Tuple

from carstage.collector.scenario.events.base import Event, event
from carstage.collector.scenario.events.cars import LEFT, RIGHT, DrivenCar, LaneLine, half_wave
from carstage.collector.scenario.events.lanes import lanes_beside
from carstage.collector.scenario.events.leader import (
    FAR,
    FREE_M,
    LEAST_M_S,
    NEAR,
    PATIENCE_S,
    ROOM_M,
)
from carstage.collector.scenario.events.surroundings import Stretch

BESIDE_S = 0.5
"""How long it drives beside the ego's lane before it moves over."""
AFTER_S = 3.0
"""How long it drives ahead then, before it becomes ordinary traffic."""
SLOWEST_M_S = 2.0
SIGHT_M = 15.0
"""That far from a junction it becomes ordinary traffic at the latest."""
BESIDE_M = 1.5
"""Farther to the side than that it is not in the ego's way yet."""


@event("cut_in")
class CutIn(Event):
    """A car appears in the lane beside, a little ahead at the ego's speed, and moves over."""

    _car: DrivenCar
    _over_m = 0.0
    _begin_m_s = 0.0

    @classmethod
    def lacking(cls, world_map: Any) -> Optional[str]:
        """Two lanes in one direction."""
        begins = (begin for begin, _ in world_map.get_topology())
        if any(lanes_beside(begin) for begin in begins if not begin.is_junction):
            return None
        return "no road with two lanes in one direction"

    def place(self) -> Optional[str]:
        """In a lane beside that leads the same way for long enough."""
        world, spec = self.world, self.spec
        speed_m_s = world.ego_speed_m_s
        if speed_m_s < LEAST_M_S:
            return "the ego was too slow to be cut in on"
        blueprint = world.draw_car()
        if blueprint is None:
            return "the server has no blueprint of a car"
        driven_m = speed_m_s * (BESIDE_S + 0.5 + spec.change_s)
        free_m = spec.gap_m + FREE_M
        stretch, reason = world.free_stretch(spec.gap_m + driven_m + ROOM_M, free_m)
        if reason is not None:
            return reason
        free = self._free_lanes(stretch, free_m)
        if not free:
            return "no lane beside the ego's led the same way, or it was taken"
        begin, over_m = free[0]
        line = LaneLine(begin)
        x, y, z, _, yaw = line.pose(spec.gap_m + 2.0 * world.ego_half_m)
        actor = world.spawn(blueprint, world.transform(x, y, z, yaw))
        if actor is None:
            return "there was no room for a car beside"
        self.actors = [actor]
        self._over_m = over_m
        along_m = spec.gap_m + world.ego_half_m + float(actor.bounding_box.extent.x)
        self._car = DrivenCar(world, actor, line, along_m, speed_m_s)
        return None

    def wait(self) -> Optional[str]:
        """Drive beside; move over once the gap is about right."""
        if self.elapsed_s > BESIDE_S + PATIENCE_S:
            return "the ego did not come beside the car"
        self._car.keep_gap(self.spec.gap_m)
        _, right_m = self.world.from_ego(self._car.actor.get_location())
        side = math.copysign(1.0, self._over_m)
        beside = NEAR <= self._car.gap_m / self.spec.gap_m <= FAR
        if self.elapsed_s >= BESIDE_S and beside and right_m * side < -BESIDE_M:
            self._begin_m_s = self.world.ego_speed_m_s
            self.begin()
        return None

    def run(self) -> bool:
        """Move over, as smoothly as a half wave of a cosine, then drive slower."""
        share = self.elapsed_s / self.spec.change_s
        right_m = self._over_m * half_wave(share)
        if share < 1.0:
            self._car.move(self._car.speed_m_s, right_m, RIGHT if self._over_m > 0.0 else LEFT)
            return True
        self._car.drive(max(self._begin_m_s - self.spec.slower_m_s, SLOWEST_M_S), right_m)
        goes_on = self.elapsed_s < self.spec.change_s + AFTER_S
        return goes_on and not self._car.is_before_junction(SIGHT_M)

    def release(self) -> None:
        """It becomes ordinary traffic."""
        self._car.hand_over()

    def _free_lanes(self, stretch: Stretch, free_m: float) -> List[Tuple[Any, float]]:
        """Lanes beside the whole stretch where nobody drives: their begins, and how far to here."""
        found = []
        for begin, side in lanes_beside(stretch.places[0]):
            lane = [
                one for place in stretch.places for one, at in lanes_beside(place) if at == side
            ]
            taken = self.world.is_taken(lane[: round(free_m)])
            if len(lane) == len(stretch.places) and not taken:
                width_m = 0.5 * (begin.lane_width + stretch.places[0].lane_width)
                found.append((begin, -side * width_m))
        return found
