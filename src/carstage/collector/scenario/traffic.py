"""The client's Traffic Manager as planned: law-abiding, or with a personality for each vehicle."""

from __future__ import annotations

import random
from typing import Any, Dict, List, Mapping

import carla

from carstage.collector.internals.lamps import DRIVING_LIGHTS
from carstage.collector.scenario.base import Population
from carstage.collector.world import WorldSession
from carstage.spec import ComfortSpec, EpisodeSpec, StationarySpec, TrafficSpec

LAW_ABIDING: Mapping[str, float] = {
    "ignore_lights_percent": 0.0,
    "ignore_signs_percent": 0.0,
    "ignore_vehicles_percent": 0.0,
    "ignore_walkers_percent": 0.0,
}


def personality(traffic: TrafficSpec, rng: random.Random) -> Dict[str, float]:
    """A vehicle's own values by name; as many draws for each vehicle, whatever is planned."""
    drawn = {
        name: low + rng.random() * (high - low)
        for name, (low, high) in sorted(traffic.spreads.items())
    }
    return dict(LAW_ABIDING, **drawn)


def personalities(spec: EpisodeSpec, vehicles: List[Any], ego: Any) -> List[Dict[str, float]]:
    """The values of each vehicle by name; the ego's are those of a law-abiding one unless asked."""
    rng = random.Random(spec.seeds.driving)
    found = []
    for vehicle in vehicles:
        values = personality(spec.traffic, rng)
        if vehicle.id == ego.id and not spec.traffic.include_ego:
            values = dict(LAW_ABIDING)
        found.append(values)
    return found


def driven_by_traffic(spec: EpisodeSpec, population: Population) -> List[Any]:
    """The vehicles that the Traffic Manager drives: the ego first, then agents, then the others.

    An ego that stands is not among them, nor is who has a driver of its own.
    """
    own = spec.ego.driver is not None or isinstance(spec.scenario, StationarySpec)
    agents = [
        agent.actor
        for agent in population.agents
        if agent.spec.vehicle is not None and agent.spec.vehicle.driver is None
    ]
    return ([] if own else [population.ego]) + agents + population.vehicles


def driven_by_others(population: Population) -> List[Any]:
    """The agents' vehicles that have drivers of their own."""
    return [
        agent.actor
        for agent in population.agents
        if agent.spec.vehicle is not None and agent.spec.vehicle.driver is not None
    ]


def planned_comfort(spec: EpisodeSpec, population: Population) -> Dict[int, ComfortSpec]:
    """How gently who of :func:`driven_by_traffic` is to drive, by actor id.

    It is told ahead of each step, which needs a world that waits. An agent far from the ego has no
    physics in hybrid mode, so that there is nothing to feel.
    """
    if not spec.timing.synchronous:
        return {}
    planned = [(population.ego, spec.ego.comfort)]
    if spec.traffic.hybrid_physics_radius_m is None:
        planned += [(agent.actor, agent.spec.ego.comfort) for agent in population.agents]
    return {actor.id: comfort for actor, comfort in planned if comfort is not None}


class TrafficDriver:
    """Drives vehicles by a Traffic Manager in this process.

    Args:
        client: ``carla.Client``.
        session: the episode's world; the Traffic Manager ends before it is given back.
        spec: the episode.
        port: where the Traffic Manager listens.
    """

    def __init__(self, client: Any, session: WorldSession, spec: EpisodeSpec, port: int) -> None:
        self._client = client
        self._session = session
        self._spec = spec
        self._port = port

    def prepare(self) -> None:
        """Start a seeded Traffic Manager that steps with the world.

        It begins by running freely, and a cycle that has begun goes on after the switch to
        synchronous mode: vehicles registered meanwhile would be driven one step more than the
        others. After one synchronous step of the world it surely waits for the next.
        """
        manager = self.manager()
        self._session.on_exit("traffic manager", manager.shut_down)
        manager.set_synchronous_mode(self._spec.timing.synchronous)
        manager.set_random_device_seed(self._spec.seeds.traffic_manager)
        radius_m = self._spec.traffic.hybrid_physics_radius_m
        manager.set_hybrid_physics_mode(radius_m is not None)
        if radius_m is not None:
            manager.set_hybrid_physics_radius(radius_m)

    def manager(self) -> Any:
        """``carla.TrafficManager``."""
        return self._client.get_trafficmanager(self._port)

    def drive(self, vehicles: List[Any], ego: Any) -> List[Dict[str, float]]:
        """Take over vehicles, the ego among them or not; the values that each was given."""
        manager = self.manager()
        lights = self._spec.weather.lights
        given = personalities(self._spec, vehicles, ego)
        for vehicle, values in zip(vehicles, given):
            vehicle.set_autopilot(True, self._port)
            self._apply(manager, vehicle, values)
            manager.update_vehicle_lights(vehicle, lights == "auto")
            if lights == "on":
                vehicle.set_light_state(carla.VehicleLightState(DRIVING_LIGHTS))
        return given

    def _apply(self, manager: Any, vehicle: Any, values: Mapping[str, float]) -> None:
        setters = {
            "speed_difference_percent": manager.vehicle_percentage_speed_difference,
            "distance_m": manager.distance_to_leading_vehicle,
            "ignore_lights_percent": manager.ignore_lights_percentage,
            "ignore_signs_percent": manager.ignore_signs_percentage,
            "ignore_vehicles_percent": manager.ignore_vehicles_percentage,
            "ignore_walkers_percent": manager.ignore_walkers_percentage,
        }
        for name, setter in setters.items():
            if name in values:
                setter(vehicle, values[name])
        manager.auto_lane_change(vehicle, self._spec.traffic.lane_changes)
        if values.get("random_lane_change_percent", 0.0) > 0.0:
            share = values["random_lane_change_percent"]
            manager.random_left_lanechange_percentage(vehicle, share)
            manager.random_right_lanechange_percentage(vehicle, share)
