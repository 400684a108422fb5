"""Event ``works_zone``."""

from __future__ import annotations

import math
from typing import Any, List, Optional, Tuple

import carla

from carstage.collector.scenario.events.base import Event, event
from carstage.collector.scenario.events.cars import LaneLine
from carstage.collector.scenario.events.lanes import lanes_beside, oncoming_lane
from carstage.collector.scenario.events.surroundings import Stretch
from carstage.collector.scenario.events.works_traffic import Works, WorksTraffic

CONES = (
    "static.prop.constructioncone",
    "static.prop.trafficcone01",
    "static.prop.trafficcone02",
)
BARRIERS = ("static.prop.streetbarrier",)
SIGNS = ("static.prop.warningconstruction", "static.prop.trafficwarning")
"""Names of CARLA's catalogue, 0.9.13 to 0.9.16; what a server lacks is left out of the choice."""
TAPER_M = 8.0
"""On such a way the row of cones comes from the lane's edge to where the works are."""
CONE_M = 2.5
"""Between cones."""
BARRIER_HALF_M = 0.6
"""Half the length of a barrier."""
SIGN_M = 10.0
"""So far before the first cone of a narrowed lane the sign stands."""
KERB_M = 0.7
"""So far beyond the lane's edge it stands then."""
BACK_M = 14.0
"""On such a way the ego is in the middle of its lane again."""
BEYOND_M = 70
"""So far beyond the works nobody may come, as the ego passes them in the oncoming lane."""
CLEAR_M = 0.6
"""Between the ego and the middles of the cones that narrow its lane, at least."""
PAST_M = 2.0
"""So far behind the ego's rear the last cone is, as it is over."""

Spot = Tuple[float, float, float]
"""Along the lane, to the right of its middle, turned (deg)."""


@event("works_zone")
class WorksZone(Event):
    """Works stand in the ego's lane; the Traffic Manager is asked to take the ego past them."""

    _traffic: Optional[WorksTraffic] = None

    def place(self) -> Optional[str]:
        """Ahead in the ego's lane, where nobody is between, with a way past them."""
        world, spec = self.world, self.spec
        if not world.can_shift_vehicles:
            return "the client's Traffic Manager keeps no distance from a lane's middle"
        last_m = spec.distance_m + TAPER_M + spec.length_m
        stretch, reason = world.free_stretch(last_m + BACK_M)
        if reason is not None:
            return reason
        lane_m = float(stretch.at(spec.distance_m).lane_width)
        works = self._way_past(stretch, lane_m, last_m)
        if works is None:
            return "there was no lane beside the ego's to pass works in it"
        reason = self._build(LaneLine(stretch.places[0]), lane_m, works)
        if reason is None:
            self._traffic = WorksTraffic(world, stretch, works)
        return reason

    def wait(self) -> Optional[str]:
        """Steer by, as soon as the ego comes; it begins at a distance from the barrier."""
        self.after()
        if self.world.will_be_near(self.actors[0].get_location(), self.spec.trigger_m):
            self.begin()
        elif self.elapsed_s > self.world.step_s and self.world.is_far(
            self.actors, 2.0 * (self.spec.distance_m + TAPER_M)
        ):
            return "the ego took another way"
        return None

    def run(self) -> bool:
        """Until the ego is past the works, and in the middle of its lane."""
        self.after()
        assert self._traffic is not None
        return not self._traffic.ego_is_past(PAST_M)

    def after(self) -> None:
        """Others come as long as the works are there."""
        if self._traffic is not None:
            self._traffic.step()

    def removed(self) -> None:
        """Everybody drives as before."""
        if self._traffic is not None:
            self._traffic.release()
            self._traffic = None

    def _way_past(self, stretch: Stretch, lane_m: float, last_m: float) -> Optional[Works]:
        """How the ego gets past; None: it cannot."""
        spec = self.spec
        begin = stretch.places[0]
        beside = lanes_beside(begin)
        if spec.extent == "narrow":
            if any(side > 0 for _, side in beside):
                return None  # the works are at the road's edge
            half_m = float(self.world.ego.bounding_box.extent.y)
            over_m = max(0.5 * spec.width_m, spec.width_m + CLEAR_M + half_m - 0.5 * lane_m)
            return Works(spec.distance_m, last_m, -over_m, spec.speed_m_s)
        lane: List[Optional[Any]]
        for side in (-1, 1):
            lane = [_beside(place, side) for place in stretch.places]
            if None not in lane:
                return self._closed(lane, side, last_m, oncoming=False)
        lane = [oncoming_lane(place) for place in stretch.places]
        return None if None in lane else self._closed(lane, -1, last_m, oncoming=True)

    def _closed(self, lane: List[Any], side: int, last_m: float, oncoming: bool) -> Works:
        spots = [(place.transform.location.x, place.transform.location.y) for place in lane]
        if oncoming:
            beyond = LaneLine(lane[-1], against=True)
            spots += [beyond.pose(each)[:2] for each in range(1, BEYOND_M)]
        width_m = float(lane[0].lane_width)
        spec = self.spec
        return Works(spec.distance_m, last_m, side * width_m, spec.speed_m_s, True, spots, oncoming)

    def _build(self, line: LaneLine, lane_m: float, works: Works) -> Optional[str]:
        """Put everything there; the barrier first."""
        world, spec = self.world, self.spec
        blueprints = [world.draw_of(names) for names in (BARRIERS, SIGNS, CONES)]
        if None in blueprints:
            return "the server has no cones, barriers or signs of works"
        spots = _closing(works, lane_m) if works.closes else _narrowing(works, lane_m, spec.width_m)
        for blueprint, places in zip(blueprints, spots):
            for along_m, right_m, turned_deg in places:
                x, y, z, pitch, yaw = line.pose(along_m, right_m, turned_deg)
                actor = world.spawn(blueprint, world.transform(x, y, z, yaw))
                if actor is None:
                    return "there was no room for works ahead"
                self.actors.append(actor)
                ground = carla.Transform(carla.Location(x, y, z), carla.Rotation(pitch, yaw, 0.0))
                world.commands.append(carla.command.ApplyTransform(actor.id, ground))
        return None


def _beside(place: Any, side: int) -> Optional[Any]:
    return next((lane for lane, at in lanes_beside(place) if at == side), None)


def _narrowing(works: Works, lane_m: float, width_m: float) -> List[List[Spot]]:
    """Where barriers, signs and cones stand at the right edge."""
    edge_m, barrier_m = 0.5 * lane_m, works.first_m + TAPER_M
    inner_m = edge_m - width_m
    return [
        [(barrier_m + 0.5, inner_m + BARRIER_HALF_M, 90.0)],
        [(works.first_m - SIGN_M, edge_m + KERB_M, 180.0)],
        _cones(works, edge_m, inner_m),
    ]


def _closing(works: Works, lane_m: float) -> List[List[Spot]]:
    """Where they stand across the lane; the cones lead to the lane in which it is passed."""
    side = -1.0 if works.over_m < 0.0 else 1.0
    edge_m, barrier_m = 0.5 * lane_m, works.first_m + TAPER_M
    between_m = max(0.25 * lane_m, BARRIER_HALF_M + 0.1)
    return [
        [(barrier_m + 0.5, between_m, 90.0), (barrier_m + 0.5, -between_m, 90.0)],
        [(barrier_m - 1.0, -side * between_m, 180.0)],
        _cones(works, -side * edge_m, side * (edge_m - 0.3)),
    ]


def _cones(works: Works, outer_m: float, inner_m: float) -> List[Spot]:
    """A row from the edge to where the works are, and along them."""
    number = math.floor((works.last_m - works.first_m) / CONE_M) + 1
    row = []
    for each in range(number):
        share = min(each * CONE_M / TAPER_M, 1.0)
        row.append((works.first_m + each * CONE_M, outer_m + share * (inner_m - outer_m), 0.0))
    return row
