"""Event ``emergency_vehicle``."""

from __future__ import annotations

from typing import Any, List, Optional

import carla

from carstage.collector.scenario.events.base import Event, event
from carstage.collector.scenario.events.cars import (
    BRAKE,
    HARD_M_S2,
    LEFT,
    RIGHT,
    DrivenCar,
    LaneLine,
    half_wave,
    straightest,
)
from carstage.collector.scenario.events.cut_in import SIGHT_M
from carstage.collector.scenario.events.lanes import lanes_beside, oncoming_lane
from carstage.collector.scenario.events.leader import LEAST_M_S, ROOM_M
from carstage.collector.scenario.events.surroundings import SPACING_M, Stretch

BLUEPRINTS = (
    "vehicle.carlamotors.firetruck",
    "vehicle.dodge.charger_police",
    "vehicle.dodge.charger_police_2020",
    "vehicle.ford.ambulance",
)
FLASHING = int(carla.VehicleLightState.Special1) | int(carla.VehicleLightState.Special2)
HALF_M = 4.3
"""Half the length of the longest of them."""
CHANGE_S = 1.5
"""How long it takes to move over."""
CLEAR_M = 2.0
"""From the ego, when it begins to swing out and when it begins to swing back."""
BESIDE_SHARE = 0.6
"""Of the time it takes to move over: then it is out of the ego's way."""
LATE_S = 15.0
"""It has as much longer than it takes by itself."""
EAGER_M_S = 1.0
"""So much faster than now the ego is taken to be meanwhile."""
LEAST_FOLLOWED_S = 3.0
"""There has to be road enough to follow so long."""
GAP_RATE = 1.0
"""Per second: how it comes up to the gap that it keeps."""
NEAR_M = 1.0
"""So much more than that gap is near."""


@event("emergency_vehicle")
class EmergencyVehicle(Event):
    """It comes from behind, its lamps on; it passes the ego, or stays behind it for a while."""

    _car: DrivenCar
    _lane: List[Any]
    _begin_m = 0.0
    _over_m = 0.0
    _out = 0.0
    _swing_s: Optional[float] = None
    _back_s: Optional[float] = None
    _near_s: Optional[float] = None

    def place(self) -> Optional[str]:
        """Behind in the ego's lane; to pass, with road ahead and a free lane beside."""
        world, spec = self.world, self.spec
        if world.ego_speed_m_s < LEAST_M_S:
            return "the ego was too slow to be followed"
        blueprint = world.draw_of(BLUEPRINTS)
        if blueprint is None:
            return "the server has no blueprint of an emergency vehicle"
        behind = self._road_behind(spec.distance_m + 2.0 * HALF_M + world.ego_half_m)
        if not behind:
            return "the road behind the ego was too short"
        if world.is_taken(behind):
            return "another vehicle was behind the ego"
        stretch, reason = world.free_stretch(self._needed_m(), self._room_m())
        if reason is not None:
            return reason
        if spec.manner == "pass" and not self._choose_lane(stretch, behind):
            return "no lane beside the ego's was free to pass it"
        line = LaneLine(behind[-1], [*behind[-2::-1], *stretch.places])
        ego_m = self._begin_m = len(behind) * SPACING_M
        x, y, z, _, yaw = line.pose(ego_m - spec.distance_m - world.ego_half_m - HALF_M)
        actor = world.spawn(blueprint, world.transform(x, y, z, yaw))
        if actor is None:
            return "there was no room for a vehicle behind"
        self.actors = [actor]
        along_m = ego_m - spec.distance_m - world.ego_half_m - float(actor.bounding_box.extent.x)
        speed_m_s = world.ego_speed_m_s + spec.faster_m_s
        self._car = DrivenCar(world, actor, line, along_m, speed_m_s)
        self._swing_s = self._back_s = self._near_s = None
        return None

    def wait(self) -> Optional[str]:
        """It comes as soon as it is there."""
        self.begin()
        self.run()
        return None

    def run(self) -> bool:
        """Come nearer; then pass, or stay behind."""
        ego_m_s, gap_m = self.world.ego_speed_m_s, self._gap_m()
        if self._swing_s is not None:
            return self._pass(ego_m_s + self.spec.faster_m_s, self._swing_s)
        near_m = self.spec.gap_m if self.spec.manner == "follow" else self._swing_gap_m()
        free = self.spec.manner == "pass" and not self.world.is_taken(self._lane)
        slower_m_s = min(GAP_RATE * (gap_m - near_m), self.spec.faster_m_s)
        nearer_m_s = self.spec.faster_m_s if free else slower_m_s
        speed_m_s = self._car.approach(max(ego_m_s + nearer_m_s, 0.0), HARD_M_S2)
        brakes = speed_m_s < self._car.speed_m_s - 1e-3
        self._car.move(speed_m_s, lights=FLASHING | (BRAKE if brakes else 0))
        near = gap_m <= near_m + NEAR_M
        if self.spec.manner == "follow":
            return self._follow(near)
        if near and free:
            self._swing_s = self.elapsed_s
        elif self._ends_late():
            self.give_up("there was no room to pass the ego")
        return True

    def release(self) -> None:
        """It becomes ordinary traffic, its lamps still on."""
        self._car.hand_over()

    def _follow(self, near: bool) -> bool:
        if near and self._near_s is None:
            self._near_s = self.elapsed_s
        if self._near_s is None and self._ends_late():
            self.give_up("it did not come near the ego before a junction")
            return True
        followed = self._near_s is not None and (
            self.elapsed_s >= self._near_s + self.spec.follow_s
        )
        return not followed and not self._sees_junction()

    def _pass(self, wanted_m_s: float, swing_s: float) -> bool:
        """Out, past the ego, and back into its lane."""
        speed_m_s = self._car.approach(wanted_m_s, HARD_M_S2)
        if self._back_s is None:
            self._out = half_wave((self.elapsed_s - swing_s) / CHANGE_S)
            lights = FLASHING | (LEFT if self._over_m < 0.0 else RIGHT)
            self._car.move(speed_m_s, self._over_m * self._out, lights)
            if self._car.gap_m >= CLEAR_M:
                self._back_s = self.elapsed_s
            return True
        share = (self.elapsed_s - self._back_s) / CHANGE_S
        lights = FLASHING | (RIGHT if self._over_m < 0.0 else LEFT)
        right_m = self._over_m * self._out * (1.0 - half_wave(share))
        self._car.drive(wanted_m_s, right_m, lights)
        return share < 1.0

    def _gap_m(self) -> float:
        """From its front to the ego's rear."""
        return -self._car.gap_m - 2.0 * (self._car.half_m + self.world.ego_half_m)

    def _swing_gap_m(self) -> float:
        """From its front to the ego's rear, when it has to move over."""
        return float(CLEAR_M + BESIDE_SHARE * CHANGE_S * self.spec.faster_m_s)

    def _needed_m(self) -> float:
        """Road before the ego, until it is past, or has followed."""
        spec, ego_m_s = self.spec, self.world.ego_speed_m_s + EAGER_M_S
        if spec.manner == "follow":
            near_s = max(spec.distance_m - spec.gap_m, 0.0) / spec.faster_m_s
            return float(ego_m_s * (near_s + min(spec.follow_s, LEAST_FOLLOWED_S)) + ROOM_M)
        passed_m = spec.distance_m + 2.0 * (HALF_M + self.world.ego_half_m) + CLEAR_M
        passed_s = passed_m / spec.faster_m_s + CHANGE_S
        return float(ego_m_s * passed_s + self._room_m())

    def _room_m(self) -> float:
        """Before the ego, where it comes to be."""
        if self.spec.manner == "follow":
            return ROOM_M
        return float(CLEAR_M + 2.0 * HALF_M + CHANGE_S * self.spec.faster_m_s)

    def _ends_late(self) -> bool:
        """Whether it cannot do what it came for: a junction is near, or too much time is over."""
        late_s = self.spec.distance_m / self.spec.faster_m_s + LATE_S
        return self.elapsed_s > late_s or self._sees_junction()

    def _sees_junction(self) -> bool:
        """Whether it comes to a junction that the ego had before it, too, when it was placed."""
        ahead = self._car.along_m + SIGHT_M > self._begin_m
        return ahead and self._car.is_before_junction(SIGHT_M)

    def _road_behind(self, length_m: float) -> List[Any]:
        """Waypoints behind the ego, the nearest first; empty where the road begins there."""
        place = self.world.here()
        places: List[Any] = []
        while len(places) * SPACING_M < length_m:
            before = place.previous(SPACING_M)
            if not before:
                return []
            place = straightest(before, place)
            places.append(place)
        return places

    def _choose_lane(self, stretch: Stretch, behind: List[Any]) -> bool:
        """A lane beside the whole stretch, left or right, where nobody drives, nor behind."""
        for side, lane_of in ((-1, _left_lane), (1, _right_lane)):
            lane: List[Any] = [lane_of(place) for place in stretch.places]
            before = [lane_of(place) for place in behind]
            if None in lane:
                continue
            self._lane = [place for place in (*before, *lane) if place is not None]
            if not self.world.is_taken(self._lane):
                width_m = 0.5 * float(lane[0].lane_width + stretch.places[0].lane_width)
                self._over_m = side * width_m
                return True
        return False


def _left_lane(place: Any) -> Optional[Any]:
    same_way = [lane for lane, side in lanes_beside(place) if side < 0]
    return same_way[0] if same_way else oncoming_lane(place)


def _right_lane(place: Any) -> Optional[Any]:
    same_way = [lane for lane, side in lanes_beside(place) if side > 0]
    return same_way[0] if same_way else None
