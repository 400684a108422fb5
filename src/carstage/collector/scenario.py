"""What the road users do: kinds of scenarios, registered by name."""

from __future__ import annotations

from typing import Any, Callable, Dict, List, Type, TypeVar

import carla

from carstage.collector.errors import SceneError
from carstage.collector.plan import EpisodeSpec
from carstage.collector.world import WorldSession

DRIVING_LIGHTS = int(carla.VehicleLightState.Position) | int(carla.VehicleLightState.LowBeam)


class Scenario:
    """Drives the road users of one episode.

    Args:
        client: ``carla.Client``.
        session: the episode's world.
        spec: the episode.
        traffic_manager_port: where the client's Traffic Manager listens.
    """

    def __init__(
        self, client: Any, session: WorldSession, spec: EpisodeSpec, traffic_manager_port: int
    ) -> None:
        self._client = client
        self._session = session
        self._spec = spec
        self._traffic_manager_port = traffic_manager_port

    def prepare(self) -> None:
        """Make what must be there when the episode takes its first step; nothing by default."""

    def start(self, ego: Any, vehicles: List[Any]) -> None:
        """Set everybody going; called once, after the first step and before the warm-up."""
        raise NotImplementedError


SCENARIOS: Dict[str, Type[Scenario]] = {}
"""Kind to class, filled by :func:`scenario`."""

ScenarioClass = TypeVar("ScenarioClass", bound=Type[Scenario])


def scenario(kind: str) -> Callable[[ScenarioClass], ScenarioClass]:
    """Class decorator that adds a kind of scenario."""

    def add(cls: ScenarioClass) -> ScenarioClass:
        SCENARIOS[kind] = cls
        return cls

    return add


def make_scenario(
    client: Any, session: WorldSession, spec: EpisodeSpec, traffic_manager_port: int
) -> Scenario:
    """The planned scenario.

    Raises:
        SceneError: unknown kind.
    """
    kind = spec.scenario["kind"]
    if kind not in SCENARIOS:
        raise SceneError(
            "scenario.kind: %r is not known." % kind, "Known are: %s." % ", ".join(SCENARIOS)
        )
    return SCENARIOS[kind](client, session, spec, traffic_manager_port)


@scenario("autopilot")
class Autopilot(Scenario):
    """Everybody, the ego too, drives by the client's Traffic Manager and keeps the law."""

    def prepare(self) -> None:
        """Start a seeded Traffic Manager that steps with the world.

        It begins by running freely, and a cycle that has begun goes on after the switch to
        synchronous mode: vehicles registered meanwhile would be driven one step more than the
        others. After one synchronous step of the world it surely waits for the next.
        """
        manager = self._client.get_trafficmanager(self._traffic_manager_port)
        self._session.on_exit("traffic manager", manager.shut_down)
        manager.set_synchronous_mode(self._spec.timing.synchronous)
        manager.set_random_device_seed(self._spec.seeds["traffic_manager"])
        manager.set_hybrid_physics_mode(False)

    def start(self, ego: Any, vehicles: List[Any]) -> None:
        """Hand all vehicles to the Traffic Manager."""
        manager = self._client.get_trafficmanager(self._traffic_manager_port)
        lights = self._spec.weather.lights
        for vehicle in [ego, *vehicles]:
            vehicle.set_autopilot(True, self._traffic_manager_port)
            for ignore in (
                manager.ignore_lights_percentage,
                manager.ignore_signs_percentage,
                manager.ignore_vehicles_percentage,
                manager.ignore_walkers_percentage,
            ):
                ignore(vehicle, 0.0)
            manager.update_vehicle_lights(vehicle, lights == "auto")
            if lights == "on":
                vehicle.set_light_state(carla.VehicleLightState(DRIVING_LIGHTS))
