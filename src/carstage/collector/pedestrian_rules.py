"""How pedestrians cross roads: they wait for the lights, and look before they step out.

CARLA's own navigation finds their ways. It looks for vehicles only a few metres around, and asks
the light whose stop line is nearest, which may be that of another arm. So who comes to a crosswalk
is stopped at the kerb here, by its greatest speed, until the road is free.
"""

from __future__ import annotations

import math
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

import carla

from carstage.collector.actors import Walker
from carstage.collector.crosswalks import Crosswalk, crosswalks
from carstage.collector.world import WorldSession

BEFORE_KERB_M = 1.2
"""Beyond the end of a crosswalk a pedestrian begins to look."""
ON_ROAD_M = 0.2
"""Who has gone that far onto a crosswalk is on the road, and goes on; farther in, wide vehicles
would touch who stands."""
BESIDE_M = 0.7
INWARD_M_S = 0.2
LOOK_M = 70.0
STANDS_M_S = 0.5
MISS_M = 3.0
TURN_M = 25.0
"""Nearer vehicles may turn towards a crosswalk that they would pass straight on."""
ARRIVED_M = 2.0
"""Who was that near to its target walks where CARLA's navigation sends it since."""
CAR_M = 2.5
"""From a vehicle's middle to its front."""
MARGIN_S = 1.0
"""Between leaving the road and the next vehicle."""
PATIENCE_S = 6.0
LEAST_GAP_S = 4.0
"""Whoever has waited long steps out when a vehicle that far away in time can brake."""
GOING_GAP_S = 3.0
"""Nearer ones stop who is on the way to the road already."""
BRAKING_M_S2 = 3.0
"""A vehicle that can stop that gently before a red light will."""
STOPPING_S = 2.5
"""Unless it is nearer than that: it is waited for until it stands."""
_CELL_M = 20.0
_OFF = (carla.TrafficLightState.Off, carla.TrafficLightState.Unknown)


class Moving(NamedTuple):
    """Where a vehicle is and how it moves, in the plane: m, m/s."""

    x: float
    y: float
    vx: float
    vy: float


class _AtKerb:
    """A pedestrian at the kerb of a crosswalk since some time: standing, or on the way."""

    def __init__(self, crosswalk: Crosswalk, since_s: float) -> None:
        self.crosswalk = crosswalk
        self.since_s = since_s
        self.stands = False
        self.goes = False


def is_free(
    crosswalk: Crosswalk,
    vehicles: Sequence[Moving],
    speed_m_s: float,
    waited_s: float,
    goes: bool = False,
) -> bool:
    """Whether a pedestrian may step out.

    Args:
        crosswalk: with its lights as they are now.
        vehicles: all that may come.
        speed_m_s: the pedestrian's.
        waited_s: how long the pedestrian has been there.
        goes: it is on its way to the road.
    """
    states = [light.get_state() for light in crosswalk.lights]
    lit = [state for state in states if state not in _OFF]
    if any(state != carla.TrafficLightState.Red for state in lit):
        return False
    gap_s = 2.0 * crosswalk.half_m / max(speed_m_s, STANDS_M_S) + MARGIN_S
    if waited_s > PATIENCE_S:
        gap_s = min(gap_s, LEAST_GAP_S)
    if goes:
        gap_s = min(gap_s, GOING_GAP_S)
    return all(_arrives_s(crosswalk, one, bool(lit)) > gap_s for one in vehicles)


def _arrives_s(crosswalk: Crosswalk, vehicle: Moving, is_red: bool) -> float:
    """Seconds until a vehicle that keeps its speed is at a crosswalk; infinite if it will not."""
    over_m, along_m = crosswalk.own(vehicle.x, vehicle.y)
    over_m_s, along_m_s = crosswalk.turned(vehicle.vx, vehicle.vy)
    speed = math.hypot(over_m_s, along_m_s)
    away_m = math.hypot(max(abs(over_m) - crosswalk.half_m, 0.0), along_m)
    if speed < STANDS_M_S or away_m > LOOK_M:
        return math.inf
    left_m = max(away_m - crosswalk.half_width_m - CAR_M, 0.0)
    if left_m > 0.0:
        closing = -(over_m * over_m_s + along_m * along_m_s)
        misses_m = abs(over_m * along_m_s - along_m * over_m_s) / speed
        if closing < 0.5 * speed * math.hypot(over_m, along_m):
            return math.inf
        if misses_m > crosswalk.half_m + MISS_M and away_m > TURN_M:
            return math.inf
        obeys = abs(over_m) < crosswalk.half_m and along_m_s * crosswalk.inbound > 0.7 * speed
        brakes = speed**2 < 2.0 * BRAKING_M_S2 * left_m
        if is_red and obeys and brakes and left_m > STOPPING_S * speed:
            return math.inf
    return left_m / speed


class PedestrianRules:
    """Holds pedestrians at the kerb of crosswalks until the road is free.

    Args:
        session: the episode's world.
        walkers: those that CARLA's navigation leads.
        step_s: simulated time of a step.
    """

    def __init__(self, session: WorldSession, walkers: Sequence[Walker], step_s: float) -> None:
        self._world = session.world
        self._walkers = list(walkers)
        self._step_s = step_s
        self._time_s = 0.0
        self._at_kerb: Dict[int, _AtKerb] = {}
        self._targets = {
            walker.actor.id: walker.target for walker in walkers if walker.target is not None
        }
        self._cells: Dict[Tuple[int, int], List[Crosswalk]] = {}
        lights = sorted(
            session.world.get_actors().filter("traffic.traffic_light"),
            key=lambda light: int(light.id),
        )
        for crosswalk in crosswalks(session.map, lights) if walkers else []:
            reach = math.ceil((crosswalk.half_m + BEFORE_KERB_M) / _CELL_M)
            column, row = _cell(*crosswalk.middle)
            for i in range(column - reach, column + reach + 1):
                for j in range(row - reach, row + reach + 1):
                    self._cells.setdefault((i, j), []).append(crosswalk)

    def before_step(self) -> None:
        """Called ahead of each step: stop who comes to a kerb, let go who may cross."""
        self._time_s += self._step_s
        if not self._cells:
            return
        snapshot = self._world.get_snapshot()
        vehicles: Optional[List[Moving]] = None
        for walker in self._walkers:
            state = snapshot.find(walker.actor.id)
            if state is not None:
                self._note_arrival(walker.actor.id, state)
            waits = None if state is None else self._comes_to(walker.actor.id, state)
            if waits is None:
                self._at_kerb.pop(walker.actor.id, None)
                continue
            self._at_kerb[walker.actor.id] = waits
            vehicles = self._vehicles(snapshot) if vehicles is None else vehicles
            self._decide(walker, waits, vehicles)

    def crosswalk_at(self, place: Any) -> Optional[Crosswalk]:
        """The crosswalk on which a ``carla.Location`` is, or at whose kerb."""
        for crosswalk in self._cells.get(_cell(place.x, place.y), ()):
            over_m, along_m = crosswalk.own(place.x, place.y)
            if (
                abs(over_m) < crosswalk.half_m + BEFORE_KERB_M
                and abs(along_m) < crosswalk.half_width_m + BESIDE_M
            ):
                return crosswalk
        return None

    def holds(self, number: int) -> bool:
        """Whether a pedestrian, by its id, stands at a kerb."""
        waits = self._at_kerb.get(number)
        return waits is not None and waits.stands

    def _decide(self, walker: Walker, waits: _AtKerb, vehicles: Sequence[Moving]) -> None:
        waited_s = self._time_s - waits.since_s
        free = is_free(waits.crosswalk, vehicles, walker.speed_m_s, waited_s, waits.goes)
        if free and waits.stands:
            walker.controller.set_max_speed(walker.speed_m_s)
            target = self._targets.get(walker.actor.id)
            if target is not None:  # the client gives up ways on which it stands
                walker.controller.go_to_location(target)
        elif not free and not waits.stands:
            walker.controller.set_max_speed(0.0)
        waits.stands, waits.goes = not free, free

    def _note_arrival(self, number: int, state: Any) -> None:
        target = self._targets.get(number)
        if target is None:
            return
        here = state.get_transform().location
        if math.hypot(here.x - target.x, here.y - target.y) < ARRIVED_M:
            del self._targets[number]

    def _comes_to(self, number: int, state: Any) -> Optional[_AtKerb]:
        """The kerb at which a pedestrian stands or arrives; None: it does neither."""
        here, velocity = state.get_transform().location, state.get_velocity()
        known = self._at_kerb.get(number)
        if known is not None:
            if known.stands or _is_at_kerb(known.crosswalk, here):
                return known
            return None
        for crosswalk in self._cells.get(_cell(here.x, here.y), ()):
            over_m, _ = crosswalk.own(here.x, here.y)
            over_m_s, _ = crosswalk.turned(velocity.x, velocity.y)
            if over_m * over_m_s < -INWARD_M_S * abs(over_m) and _is_at_kerb(crosswalk, here):
                return _AtKerb(crosswalk, self._time_s)
        return None

    def _vehicles(self, snapshot: Any) -> List[Moving]:
        found = []
        for vehicle in self._world.get_actors().filter("vehicle.*"):
            state = snapshot.find(vehicle.id)
            if state is not None:
                here, velocity = state.get_transform().location, state.get_velocity()
                found.append(Moving(here.x, here.y, velocity.x, velocity.y))
        return found


def _is_at_kerb(crosswalk: Crosswalk, place: Any) -> bool:
    over_m, along_m = crosswalk.own(place.x, place.y)
    beyond_m = abs(over_m) - crosswalk.half_m
    beside = abs(along_m) < crosswalk.half_width_m + BESIDE_M
    return beside and -ON_ROAD_M <= beyond_m <= BEFORE_KERB_M


def _cell(x: float, y: float) -> Tuple[int, int]:
    return math.floor(x / _CELL_M), math.floor(y / _CELL_M)
