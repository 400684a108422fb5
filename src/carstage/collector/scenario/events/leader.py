"""Event ``hard_braking_leader``."""

from __future__ import annotations

from typing import Optional

from carstage.collector.scenario.events.base import Event, event
from carstage.collector.scenario.events.cars import BRAKE, DrivenCar, LaneLine
from carstage.collector.scenario.events.surroundings import Stretch

LEAST_M_S = 4.0
"""An ego that is slower is about to stop, or has just begun."""
PATIENCE_S = 5.0
ROOM_M = 6.0
"""More road than what happens takes."""
FREE_M = 15.0
"""So much room a car needs, and before it."""
NEAR, FAR = 0.6, 1.6
"""Of the gap that is asked for: within them it may begin."""


@event("hard_braking_leader")
class HardBrakingLeader(Event):
    """A car leads, brakes to a stop, and drives on: the one ahead, or one that appears there."""

    _car: DrivenCar
    _stands_s = 0.0

    def place(self) -> Optional[str]:
        """Ahead in the ego's lane, where nobody drives and no junction comes soon."""
        world, spec = self.world, self.spec
        speed_m_s = world.ego_speed_m_s
        if speed_m_s < LEAST_M_S:
            return "the ego was too slow to follow anybody"
        blueprint = world.draw_car()
        if blueprint is None:
            return "the server has no blueprint of a car"
        braking_m = speed_m_s**2 / (2.0 * spec.deceleration_m_s2)
        needed_m = spec.gap_m + speed_m_s * (spec.lead_s + 0.5) + braking_m + ROOM_M
        stretch, reason = world.free_stretch(needed_m, spec.gap_m + FREE_M)
        if stretch.length_m >= needed_m and self._adopt(stretch):
            return None
        if reason is not None:
            return reason
        line = LaneLine(stretch.places[0])
        x, y, z, _, yaw = line.pose(spec.gap_m + 2.0 * world.ego_half_m)
        actor = world.spawn(blueprint, world.transform(x, y, z, yaw))
        if actor is None:
            return "there was no room for a car ahead"
        self.actors = [actor]
        along_m = spec.gap_m + world.ego_half_m + float(actor.bounding_box.extent.x)
        self._car = DrivenCar(world, actor, line, along_m, speed_m_s)
        return None

    def _adopt(self, stretch: Stretch) -> bool:
        """Take over the car that drives ahead at about the right distance, if there is one."""
        found = self.world.car_ahead(stretch)
        if found is None:
            return False
        (actor, _, speed_m_s), along_m, right_m = found
        gap_m = along_m - float(actor.bounding_box.extent.x) - self.world.ego_half_m
        if speed_m_s < LEAST_M_S or not NEAR <= gap_m / self.spec.gap_m <= FAR:
            return False
        self.world.take_over(actor)
        self.actors, self.adopted = [actor], True
        along_m += speed_m_s * self.world.step_s
        line = LaneLine(stretch.places[0])
        self._car = DrivenCar(self.world, actor, line, along_m, speed_m_s, right_m)
        return True

    def wait(self) -> Optional[str]:
        """Lead; brake once the gap is about right and the ego follows."""
        if self.elapsed_s > self.spec.lead_s + PATIENCE_S:
            return "the ego did not follow the car ahead"
        self._car.keep_gap(self.spec.gap_m)
        _, right_m = self.world.from_ego(self._car.actor.get_location())
        follows = NEAR <= self._car.gap_m / self.spec.gap_m <= FAR and abs(right_m) < 2.0
        if self.elapsed_s >= self.spec.lead_s and follows and self.world.ego_speed_m_s > LEAST_M_S:
            self.begin()
        return None

    def run(self) -> bool:
        """Brake, then stand."""
        self._car.move(self._car.approach(0.0, self.spec.deceleration_m_s2), lights=BRAKE)
        if self._car.speed_m_s <= 0.0:
            self._stands_s += self.world.step_s
        return bool(self._stands_s < self.spec.stand_s + 0.5 * self.world.step_s)

    def release(self) -> None:
        """It becomes ordinary traffic."""
        self.world.light(self._car.actor)
        self._car.hand_over()
