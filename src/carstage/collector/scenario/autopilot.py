"""Scenarios in which the client's Traffic Manager drives: autopilot, route, stationary."""

from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping, Optional, Sequence, Union

import carla

from carstage.collector.comfort import ComfortableDriving, comfortable
from carstage.collector.internals.errors import SceneError
from carstage.collector.internals.plan import ProgramPlan, ServerPlan
from carstage.collector.maps import spawn_points
from carstage.collector.scenario.base import Population, Scenario, scenario
from carstage.collector.scenario.routing import RoadGraph
from carstage.collector.scenario.traffic import (
    TrafficDriver,
    driven_by_others,
    driven_by_traffic,
    planned_comfort,
)
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec, Place, RouteSpec

_LOOK_M = 2.0
"""Between the places of lanes that are looked at for a height."""


def places_of(session: WorldSession, spec: EpisodeSpec) -> List[Any]:
    """``carla.Location`` of each place that the ego is to drive through; none but on a route.

    Raises:
        SceneError: the map has no such spawn point.
    """
    scenario = spec.scenario
    if not isinstance(scenario, RouteSpec):
        return []
    lanes: List[Any] = []
    if any(isinstance(place, Place) for place in scenario.through):
        found = session.map.generate_waypoints(_LOOK_M)
        lanes = [waypoint.transform.location for waypoint in found]
    return [_location(session, spec, place, i, lanes) for i, place in enumerate(scenario.through)]


def _location(
    session: WorldSession,
    spec: EpisodeSpec,
    place: Union[int, Place],
    index: int,
    lanes: Sequence[Any],
) -> Any:
    if not isinstance(place, int):
        return _on_road(place, lanes)
    points = spawn_points(session.map)
    if place >= len(points):
        raise SceneError(
            "scenario.through[%d]: map %s has no spawn point %d." % (index, spec.map, place),
            "Use 0 to %d." % (len(points) - 1),
        )
    return points[place].location


def _on_road(place: Place, lanes: Sequence[Any]) -> Any:
    """``carla.Location`` of a place, at the height of the lane that is nearest in the plane.

    The client looks for lanes in space: at height 0 it finds a lower road beside an elevated one.
    Where roads lie one above another, the one nearer to height 0 counts.
    """
    apart = [(math.hypot(lane.x - place.x_m, lane.y - place.y_m), lane.z) for lane in lanes]
    nearest_m = min((apart_m for apart_m, _ in apart), default=0.0)
    heights = [z for apart_m, z in apart if apart_m < nearest_m + _LOOK_M / 2.0]
    return carla.Location(place.x_m, place.y_m, min(heights, key=abs, default=0.0))


@scenario("autopilot")
class Autopilot(Scenario):
    """Everybody, the ego too, drives by the client's Traffic Manager, wherever it likes."""

    may_place = True

    def __init__(
        self,
        client: Any,
        session: WorldSession,
        spec: EpisodeSpec,
        server: ServerPlan,
        program: Optional[ProgramPlan] = None,
    ) -> None:
        super().__init__(client, session, spec, server, program)
        self._driver = TrafficDriver(client, session, spec, server.traffic_manager_port)
        self._lit: List[Any] = []
        self._comfortable: Dict[int, ComfortableDriving] = {}

    def prepare(self) -> None:
        """Start the Traffic Manager."""
        self._driver.prepare()

    def start(self, population: Population) -> None:
        """Walkers walk, vehicles drive."""
        super().start(population)
        ego = population.ego
        own = self._spec.ego.driver is not None
        self._lit = ([ego] if own else []) + driven_by_others(population)
        self._drive(population)

    def _drive(self, population: Population) -> None:
        """Have the Traffic Manager take over, gently where that is planned."""
        spec, driven = self._spec, driven_by_traffic(self._spec, population)
        given = self._driver.drive(driven, population.ego)
        comfort = planned_comfort(spec, population)
        planned = [
            (vehicle, comfort[vehicle.id], values)
            for vehicle, values in zip(driven, given)
            if vehicle.id in comfort
        ]
        manager = self._driver.manager()
        self._comfortable = comfortable(manager, self._session, spec.step_s, planned)

    def driven_gently(self) -> Mapping[int, ComfortableDriving]:
        """The ego and agents that are planned to."""
        return self._comfortable

    def before_step(self, tick: Optional[int]) -> None:
        """Drive gently; keep lights of vehicles with drivers of their own fit for the weather."""
        for driving in self._comfortable.values():
            driving.before_step()
        if self._lit:
            self._lamps.light(self._lit, self._session.weather.values)


@scenario("route")
class Route(Autopilot):
    """The ego drives through the planned places; then as it likes."""

    def start(self, population: Population) -> None:
        """Find the way by road and hand it to the Traffic Manager, if that drives the ego.

        Raises:
            SceneError: no road leads from one place to the next.
        """
        if self._spec.ego.driver is not None:
            super().start(population)
            return
        graph = RoadGraph(self._session.map)
        here = population.ego.get_transform().location
        path: List[Any] = []
        for index, there in enumerate(places_of(self._session, self._spec)):
            way = graph.way(here, there)
            if way is None:
                raise SceneError(
                    "scenario.through[%d]: no road leads there from the place before." % index,
                    "Choose a place that can be reached; roads have directions.",
                )
            path += way
            here = there
        super().start(population)
        self._driver.manager().set_path(population.ego, path)


@scenario("stationary")
class Stationary(Autopilot):
    """The ego stands with its hand brake on; the others drive."""

    def start(self, population: Population) -> None:
        """Everybody but the ego goes."""
        Scenario.start(self, population)
        population.ego.apply_control(carla.VehicleControl(brake=1.0, hand_brake=True))
        self._lit = [population.ego, *driven_by_others(population)]
        self._drive(population)
