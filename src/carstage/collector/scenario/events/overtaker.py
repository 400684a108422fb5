"""Event ``oncoming_overtaker``."""

from __future__ import annotations

from typing import Any, List, Optional

from carstage.collector.scenario.events.base import Event, event
from carstage.collector.scenario.events.cars import LEFT, RIGHT, DrivenCar, LaneLine, half_wave
from carstage.collector.scenario.events.lanes import oncoming_lane
from carstage.collector.scenario.events.leader import LEAST_M_S
from carstage.collector.scenario.events.surroundings import Stretch

LEAD_S = 0.2
"""So long before it swings out both cars appear: the ego's speed is nearly the same then."""
CLEAR_M = 2.0
"""From car to car, when it begins to swing out and when it begins to swing back."""
BESIDE_SHARE = 0.6
"""Of the time it takes to move over: then it is out of the other's way."""
AFTER_S = 4.0
"""It becomes ordinary traffic that long after it came back, or once it has met the ego."""
BEND_M = 3.0
"""Straight ahead the cars are at most that much nearer than along the road."""
BEYOND_M = 10.0
"""So far behind both cars nobody may come."""


@event("oncoming_overtaker")
class OncomingOvertaker(Event):
    """Two cars come towards the ego; the one behind passes the other in the ego's lane."""

    _car: DrivenCar
    _other: DrivenCar
    _width_m = 0.0
    _out = 0.0
    _back_since_s: Optional[float] = None

    @classmethod
    def lacking(cls, world_map: Any) -> Optional[str]:
        """A road with a lane in each direction, beside each other."""
        begins = (begin for begin, _ in world_map.get_topology())
        if any(oncoming_lane(begin) for begin in begins if not begin.is_junction):
            return None
        return "no road on which cars come towards each other in lanes side by side"

    def place(self) -> Optional[str]:
        """Ahead in the oncoming lane, where nobody drives, nor in the ego's."""
        world, spec = self.world, self.spec
        if world.ego_speed_m_s < LEAST_M_S:
            return "the ego was too slow to meet anybody"
        blueprints = [world.draw_car(), world.draw_car()]
        if None in blueprints:
            return "the server has no blueprint of a car"
        ahead_m = spec.distance_m + LEAD_S * (world.ego_speed_m_s + spec.speed_m_s)
        stretch, reason = world.free_stretch(ahead_m + BEND_M)
        if reason is not None:
            return reason
        lane = self._free_lane(stretch)
        if not lane:
            return "no lane beside the ego's came towards it, or it was taken"
        here = world.ego.get_location()
        far = [one for one in lane if one.transform.location.distance(here) >= ahead_m]
        if not far:
            return "the road ahead bent too much"
        begin = far[0]
        self._width_m = 0.5 * float(begin.lane_width + stretch.places[0].lane_width)
        line = LaneLine(begin)
        gap_m = self._swing_gap_m() + LEAD_S * spec.slower_m_s
        for blueprint, along_m in zip(blueprints, (0.0, gap_m + 2.0 * world.ego_half_m)):
            x, y, z, _, yaw = line.pose(along_m)
            actor = world.spawn(blueprint, world.transform(x, y, z, yaw))
            if actor is None:
                return "there was no room for cars that come towards the ego"
            self.actors.append(actor)
        halves_m = sum(float(actor.bounding_box.extent.x) for actor in self.actors)
        slow_m_s = spec.speed_m_s - spec.slower_m_s
        self._car = DrivenCar(world, self.actors[0], line, 0.0, spec.speed_m_s)
        self._other = DrivenCar(world, self.actors[1], line, gap_m + halves_m, slow_m_s)
        self._back_since_s = None
        return None

    def wait(self) -> Optional[str]:
        """Come up behind the other car; swing out once it is near."""
        self._other.move(self.spec.speed_m_s - self.spec.slower_m_s)
        self._car.move(self.spec.speed_m_s)
        if self._lag_m() <= self._swing_gap_m():
            self.begin()
        return None

    def run(self) -> bool:
        """Out, past the other car, and back; then on until it has met the ego."""
        spec = self.spec
        self._other.drive(spec.speed_m_s - spec.slower_m_s)
        speed_m_s = self._car.approach(spec.speed_m_s)
        if self._back_since_s is None:
            self._out = half_wave(self.elapsed_s / spec.change_s)
            self._car.move(speed_m_s, -self._width_m * self._out, LEFT)
            if self._lead_m() >= CLEAR_M:
                self._back_since_s = self.elapsed_s
            return True
        back_s = self.elapsed_s - self._back_since_s
        share = back_s / spec.change_s
        right_m = -self._width_m * self._out * (1.0 - half_wave(share))
        if share < 1.0:
            self._car.move(speed_m_s, right_m, RIGHT)
            return True
        self._car.drive(spec.speed_m_s, right_m)
        ahead_m, _ = self.world.from_ego(self._car.actor.get_location())
        return ahead_m > 0.0 and back_s < spec.change_s + AFTER_S

    def release(self) -> None:
        """Both become ordinary traffic."""
        self._car.hand_over()
        self._other.hand_over()

    def _swing_gap_m(self) -> float:
        """From car to car: what it gains while it moves over, and a little."""
        return float(CLEAR_M + BESIDE_SHARE * self.spec.change_s * self.spec.slower_m_s)

    def _lead_m(self) -> float:
        """From the other's front to its rear, along their line; negative before it is past."""
        return self._car.along_m - self._other.along_m - self._car.half_m - self._other.half_m

    def _lag_m(self) -> float:
        """From its front to the other's rear."""
        return self._other.along_m - self._car.along_m - self._car.half_m - self._other.half_m

    def _free_lane(self, stretch: Stretch) -> List[Any]:
        """The oncoming lane beside the whole stretch; empty if it is none, or somebody is there."""
        lane = [oncoming_lane(place) for place in stretch.places]
        if None in lane:
            return []
        behind = LaneLine(lane[-1], against=True)
        beyond = [behind.pose(each)[:2] for each in range(1, round(BEYOND_M))]
        free = not self.world.is_taken(lane) and self.world.first_taken(beyond) is None
        return lane if free else []
