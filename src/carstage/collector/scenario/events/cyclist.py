"""Event ``wrong_way_cyclist``."""

from __future__ import annotations

from typing import Optional

from carstage.collector.scenario.events.base import Event, event
from carstage.collector.scenario.events.cars import DrivenCar, LaneLine
from carstage.collector.scenario.events.leader import ROOM_M

BLUEPRINTS = (
    "vehicle.bh.crossbike",
    "vehicle.diamondback.century",
    "vehicle.gazelle.omafiets",
)
BEHIND_M = 5.0
"""So far behind the ego's middle it has passed it."""
LATE = 3.0
"""It has as much longer than it takes to ride all the way by itself."""


@event("wrong_way_cyclist")
class WrongWayCyclist(Event):
    """A cyclist comes along the kerb of the ego's lane, and rides on."""

    _bike: DrivenCar
    _aside_m = 0.0

    def place(self) -> Optional[str]:
        """Ahead in the ego's lane, where nobody is between."""
        world, spec = self.world, self.spec
        blueprint = world.draw_of(BLUEPRINTS)
        if blueprint is None:
            return "the server has no blueprint of a bicycle"
        stretch, reason = world.free_stretch(spec.distance_m + ROOM_M)
        if reason is not None:
            return reason
        begin = stretch.at(spec.distance_m)
        line = LaneLine(begin, against=True)
        aside_m = spec.kerb_m - 0.5 * float(begin.lane_width)  # the ego's right is the rider's left
        x, y, z, _, yaw = line.pose(0.0, aside_m)
        actor = world.spawn(blueprint, world.transform(x, y, z, yaw))
        if actor is None:
            return "there was no room for a cyclist at the kerb"
        self.actors = [actor]
        self._bike = DrivenCar(world, actor, line, 0.0, spec.speed_m_s, aside_m)
        self._aside_m = aside_m
        return None

    def wait(self) -> Optional[str]:
        """Ride until the ego is near."""
        self.after()
        ahead_m, _ = self.world.from_ego(self._bike.actor.get_location())
        if self.elapsed_s > self._longest_s():
            return "the ego did not come near the cyclist"
        if ahead_m > 0.0 and self.world.will_be_near(self._bike.place, self.spec.trigger_m):
            self.begin()
        return None

    def run(self) -> bool:
        """Ride on, until it is behind the ego."""
        self.after()
        ahead_m, _ = self.world.from_ego(self._bike.actor.get_location())
        return ahead_m > -BEHIND_M and self.elapsed_s < self._longest_s()

    def after(self) -> None:
        """It rides on at the kerb as long as it is near."""
        self._bike.move(self.spec.speed_m_s, self._aside_m)

    def _longest_s(self) -> float:
        return float(LATE * (self.spec.distance_m + ROOM_M) / self.spec.speed_m_s)
