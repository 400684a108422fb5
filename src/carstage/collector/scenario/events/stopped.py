"""Event ``stopped_vehicle``."""

from __future__ import annotations

from typing import Optional

from carstage.collector.scenario.events.base import Event, event
from carstage.collector.scenario.events.cars import HAZARD, DrivenCar, LaneLine
from carstage.collector.scenario.events.leader import ROOM_M


@event("stopped_vehicle")
class StoppedVehicle(Event):
    """A car stands in the ego's lane, its hazard lights on; then the Traffic Manager drives it."""

    _car: DrivenCar

    def place(self) -> Optional[str]:
        """Ahead in the ego's lane, where nobody is between."""
        world, spec = self.world, self.spec
        blueprint = world.draw_car()
        if blueprint is None:
            return "the server has no blueprint of a car"
        stretch, reason = world.free_stretch(spec.distance_m + ROOM_M)
        if reason is not None:
            return reason
        line = LaneLine(stretch.places[0])
        x, y, z, _, yaw = line.pose(spec.distance_m)
        actor = world.spawn(blueprint, world.transform(x, y, z, yaw))
        if actor is None:
            return "there was no room for a car ahead"
        self.actors = [actor]
        self._car = DrivenCar(world, actor, line, spec.distance_m, 0.0)
        return None

    def wait(self) -> Optional[str]:
        """Stand until the ego is near."""
        self._car.move(0.0, lights=HAZARD)
        ahead_m, _ = self.world.from_ego(self._car.actor.get_location())
        if self.elapsed_s > self.world.step_s and self.world.is_far(
            self.actors, self.spec.distance_m + ROOM_M
        ):
            return "the ego took another way"
        if ahead_m > 0.0 and self.world.will_be_near(self._car.place, self.spec.trigger_m):
            self.begin()
        return None

    def run(self) -> bool:
        """Stand on."""
        self._car.move(0.0, lights=HAZARD)
        return bool(self.elapsed_s < self.spec.stand_s)

    def release(self) -> None:
        """It becomes ordinary traffic."""
        self.world.light(self._car.actor)
        self._car.hand_over()
