"""What events see of the world around the ego, and how they change it."""

from __future__ import annotations

import math
import random
from types import MappingProxyType
from typing import Any, Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

import carla

from carstage.collector.actors import dress
from carstage.collector.client import is_known_gone
from carstage.collector.comfort import ComfortableDriving
from carstage.collector.internals.lamps import planned_lights
from carstage.collector.scenario.base import Population
from carstage.collector.scenario.events.signals import HeldSignals
from carstage.collector.scenario.traffic import driven_by_traffic, personalities
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec
from carstage.spec.vehicle_classes import vehicle_class

SPACING_M = 1.0
"""Between the places of a stretch of road."""
LANE_HALF_M = 1.9
"""A vehicle whose middle is that near to the middle of a lane is in it."""
STANDS_M_S = 0.5
"""A vehicle that is slower stands."""
DROPS_M = (0.2, 0.6)
"""Heights above the road to try: a spawn that touches it fails."""
ROLE = "event"
KMH_PER_M_S = 3.6


class Stretch(NamedTuple):
    """The road that the ego has before it, up to the next junction or fork.

    ``places``: waypoints a metre apart, the first one beside the ego.
    """

    places: List[Any]

    @property
    def length_m(self) -> float:
        """Its length."""
        return (len(self.places) - 1) * SPACING_M

    @property
    def ends_at_junction(self) -> bool:
        """Whether a junction comes right after it."""
        following = self.places[-1].next(SPACING_M) if self.places else []
        return any(place.is_junction for place in following)

    def at(self, distance_m: float) -> Any:
        """The waypoint at a distance along it."""
        return self.places[min(round(distance_m / SPACING_M), len(self.places) - 1)]


class Seen(NamedTuple):
    """An actor that is there, as the client knows it: ``carla.Transform``, m/s on the ground."""

    actor: Any
    transform: Any
    speed_m_s: float


def look_at(actor: Any) -> Seen:
    """What the client knows of an actor that is there."""
    return _seen(actor, actor)


def seen(world: Any, actors: Iterable[Any]) -> List[Seen]:
    """Those of some actors that the last frame shows, as it shows them.

    The Traffic Manager, or a world that runs on its own, may destroy one at any time. Who has just
    been spawned is shown by the next frame only.

    Args:
        world: ``carla.World``.
        actors: in any order, which is kept.
    """
    snapshot, there = world.get_snapshot(), []
    for actor in actors:
        state = snapshot.find(actor.id)
        if state is not None:
            there.append(_seen(actor, state))
    return there


def _seen(actor: Any, state: Any) -> Seen:
    velocity = state.get_velocity()
    return Seen(actor, state.get_transform(), math.hypot(velocity.x, velocity.y))


def _first_taken(
    spots: Sequence[Tuple[float, float]], places: Sequence[Any], half_m: float
) -> Optional[int]:
    for index, (x, y) in enumerate(spots):
        if any(math.hypot(at.x - x, at.y - y) < half_m for at in places):
            return index
    return None


class Surroundings:
    """The ego, the road ahead, other vehicles; and a list of commands for the next step.

    All that is read is what the client knows of the last step; only spawning asks the server.

    Args:
        session: the episode's world.
        spec: the episode.
        population: who was spawned.
        traffic_manager_port: where the client's Traffic Manager listens.
        rng: of the events.
        gently: who drives with comfort, by actor id.
    """

    def __init__(
        self,
        session: WorldSession,
        spec: EpisodeSpec,
        population: Population,
        traffic_manager_port: int,
        rng: random.Random,
        gently: Mapping[int, ComfortableDriving] = MappingProxyType({}),
    ) -> None:
        self._session = session
        self._spec = spec
        self._port = traffic_manager_port
        agents = [agent.actor for agent in population.agents if agent.spec.vehicle is not None]
        self._all_vehicles = [*population.vehicles, *agents]
        self._lane_keepers: Set[Any] = set()
        self._held_signals: Dict[int, List[HeldSignals]] = {}
        self._lights: Dict[int, int] = {}
        self._gently = gently
        driven = driven_by_traffic(spec, population)
        values = personalities(spec, driven, population.ego)
        self._slower = {
            vehicle.id: each.get("speed_difference_percent", 0.0)
            for vehicle, each in zip(driven, values)
        }
        self.ego = population.ego
        self.rng = rng
        self.step_s = spec.step_s
        self.time_s = 0.0
        self.commands: List[Any] = []

    @property
    def _vehicles(self) -> List[Seen]:
        """All but the ego that are there: the Traffic Manager destroys who stands too long."""
        return seen(self._session.world, self._all_vehicles)

    @property
    def ego_speed_m_s(self) -> float:
        """How fast the ego drives."""
        velocity = self.ego.get_velocity()
        return math.hypot(velocity.x, velocity.y)

    @property
    def ego_half_m(self) -> float:
        """Half the ego's length."""
        return float(self.ego.bounding_box.extent.x)

    def from_ego(self, place: Any) -> Tuple[float, float]:
        """How far a ``carla.Location`` is ahead of the ego's middle, and to its right."""
        transform = self.ego.get_transform()
        yaw = math.radians(transform.rotation.yaw)
        x, y = place.x - transform.location.x, place.y - transform.location.y
        return x * math.cos(yaw) + y * math.sin(yaw), y * math.cos(yaw) - x * math.sin(yaw)

    def is_gone(self, actor: Any) -> bool:
        """Whether the last frame shows that an actor is no longer there."""
        return is_known_gone(self._session.world, actor)

    def is_far(self, actors: Sequence[Any], distance_m: float) -> bool:
        """Whether all of them that are there are farther from the ego than that."""
        here = self.ego.get_location()
        places = [one.transform.location for one in seen(self._session.world, actors)]
        return all(place.distance(here) > distance_m for place in places)

    @property
    def step_m(self) -> float:
        """How far the ego comes in the step that is about to be made, if it goes on as it does."""
        return self.ego_speed_m_s * self.step_s

    def will_be_near(self, place: Any, distance_m: float) -> bool:
        """Whether the ego is so near to a ``carla.Location`` after the step, if it goes on.

        What the client knows is of the step before. An event that waited for it to say so would
        begin one step late, and be recorded as begun another step later.
        """
        here, velocity = self.ego.get_location(), self.ego.get_velocity()
        there = carla.Location(
            here.x + velocity.x * self.step_s,
            here.y + velocity.y * self.step_s,
            here.z + velocity.z * self.step_s,
        )
        return bool(there.distance(place) <= distance_m)

    def here(self) -> Any:
        """The waypoint at which the ego is."""
        return self._session.map.get_waypoint(self.ego.get_location())

    def stretch(self, longest_m: float) -> Stretch:
        """The road ahead, as long as there is no choice of ways, at most that long."""
        place = self.here()
        places: List[Any] = []
        while not place.is_junction:
            places.append(place)
            following = place.next(SPACING_M)
            if (len(places) - 1) * SPACING_M >= longest_m or len(following) != 1:
                break
            place = following[0]
        return Stretch(places)

    def free_stretch(
        self, needed_m: float, free_m: Optional[float] = None
    ) -> Tuple[Stretch, Optional[str]]:
        """The road ahead, and why it is of no use: a junction is near, or somebody drives there.

        Args:
            needed_m: so long it has to be.
            free_m: so far ahead nobody may drive; None: nowhere.
        """
        stretch = self.stretch(needed_m)
        if not stretch.places:
            return stretch, "the ego was in a junction"
        if stretch.length_m < needed_m:
            return stretch, "the road ahead had no %.0f m without a junction" % needed_m
        far = len(stretch.places) if free_m is None else round(free_m / SPACING_M)
        if self.is_taken(stretch.places[:far]):
            return stretch, "another vehicle was ahead of the ego"
        return stretch, None

    def is_taken(self, places: Sequence[Any], half_m: float = LANE_HALF_M) -> bool:
        """Whether a vehicle but the ego is within half a lane of one of the waypoints."""
        spots = [place.transform.location for place in places]
        return self.first_taken([(spot.x, spot.y) for spot in spots], half_m) is not None

    def first_taken(
        self,
        spots: Sequence[Tuple[float, float]],
        half_m: float = LANE_HALF_M,
        but: Optional[Any] = None,
    ) -> Optional[int]:
        """Which of some places is the first with a vehicle; neither the ego counts nor ``but``."""
        places = [
            one.transform.location
            for one in self._vehicles
            if but is None or one.actor.id != but.id
        ]
        return _first_taken(spots, places, half_m)

    def is_crossed(self, places: Sequence[Any], within_m: float, but: Any) -> bool:
        """Whether a vehicle drives near a row of waypoints; neither the ego counts nor ``but``."""
        spots = [place.transform.location for place in places]
        for one in self._vehicles:
            at = one.transform.location
            drives = one.actor.id != but.id and one.speed_m_s > STANDS_M_S
            if drives and any(math.hypot(at.x - s.x, at.y - s.y) < within_m for s in spots):
                return True
        return False

    def car_ahead(self, stretch: Stretch) -> Optional[Tuple[Seen, float, float]]:
        """The first vehicle ahead, if the Traffic Manager drives it and it has four wheels.

        Returns:
            The vehicle, and where it is: along the stretch, and to the right of its lane's middle.
        """
        vehicles = self._vehicles
        spots = [(one.transform.location.x, one.transform.location.y) for one in stretch.places]
        first = _first_taken(spots, [one.transform.location for one in vehicles], LANE_HALF_M)
        if first is None:
            return None
        (x, y), yaw = spots[first], math.radians(stretch.places[first].transform.rotation.yaw)
        vehicle = min(
            vehicles,
            key=lambda one: math.hypot(one.transform.location.x - x, one.transform.location.y - y),
        )
        attributes = vehicle.actor.attributes
        if attributes.get("role_name") == ROLE or attributes.get("number_of_wheels") != "4":
            return None
        at = vehicle.transform.location
        ahead_m = (at.x - x) * math.cos(yaw) + (at.y - y) * math.sin(yaw)
        right_m = (at.y - y) * math.cos(yaw) - (at.x - x) * math.sin(yaw)
        return vehicle, first * SPACING_M + ahead_m, right_m

    def take_over(self, actor: Any) -> None:
        """Have the Traffic Manager drive a vehicle no longer."""
        actor.set_autopilot(False, self._port)

    @staticmethod
    def transform(x: float, y: float, z: float, yaw_deg: float) -> Any:
        """A place on the ground and a heading, as ``carla.Transform``."""
        return carla.Transform(carla.Location(x, y, z), carla.Rotation(0.0, yaw_deg, 0.0))

    def spawn(self, blueprint: Any, transform: Any) -> Optional[Any]:
        """Spawn somebody a little above a place on the ground; None where there is no room."""
        if blueprint.has_attribute("role_name"):  # walkers of some servers have none
            blueprint.set_attribute("role_name", ROLE)
        for drop_m in DROPS_M:
            above = carla.Location(
                transform.location.x, transform.location.y, transform.location.z + drop_m
            )
            actor = self._session.try_spawn(blueprint, carla.Transform(above, transform.rotation))
            if actor is not None:
                self._session.destroy_on_exit("event's actor %d" % actor.id, actor)
                if actor.type_id.startswith("vehicle."):
                    self._all_vehicles.append(actor)
                return actor
        return None

    def remove(self, actors: Sequence[Any]) -> None:
        """Destroy actors now."""
        gone = {actor.id for actor in actors}
        self._all_vehicles = [one for one in self._all_vehicles if one.id not in gone]
        if gone:
            destroy = [carla.command.DestroyActor(actor_id) for actor_id in sorted(gone)]
            self._session.client.apply_batch_sync(destroy, False)

    def draw(self, pattern: str, **attributes: str) -> Optional[Any]:
        """A blueprint of a family whose attributes have these values, where it has them."""
        return self._chosen(self._fitting(pattern, **attributes))

    def _fitting(self, pattern: str, **attributes: str) -> List[Any]:
        """All such blueprints, by their ids."""
        library = sorted(
            self._session.world.get_blueprint_library().filter(pattern),
            key=lambda blueprint: str(blueprint.id),
        )
        return [
            blueprint
            for blueprint in library
            if all(
                not blueprint.has_attribute(name)
                or str(blueprint.get_attribute(name).as_str()) == value
                for name, value in attributes.items()
            )
        ]

    def draw_of(self, blueprints: Sequence[str]) -> Optional[Any]:
        """One of these blueprints, of those that the server has."""
        library = self._session.world.get_blueprint_library()
        found = {str(blueprint.id): blueprint for blueprint in library}
        return self._chosen([found[name] for name in blueprints if name in found])

    def _chosen(self, blueprints: Sequence[Any]) -> Optional[Any]:
        if not blueprints:
            return None
        chosen = self.rng.choice(blueprints)
        dress(chosen, self.rng)
        return chosen

    def draw_car(self) -> Optional[Any]:
        """The blueprint of a passenger car."""
        fitting = self._fitting("vehicle.*", base_type="car", special_type="")
        return self._chosen([blueprint for blueprint in fitting if _is_car(blueprint)])

    def light(self, actor: Any, bits: int = 0) -> None:
        """Set a vehicle's lights: what the weather asks for, and these."""
        bits |= planned_lights(self._spec.weather.lights, self._session.weather.values)
        if self._lights.get(actor.id) != bits:
            self._lights[actor.id] = bits
            state = carla.VehicleLightState(bits)
            self.commands.append(carla.command.SetVehicleLightState(actor.id, state))

    def keep_lane(self, event: Any, keeps: bool) -> None:
        """Have the ego stay in its lane until no event wants it to: then it changes as planned."""
        if keeps:
            self._lane_keepers.add(event)
        else:
            self._lane_keepers.discard(event)
        manager = self._session.client.get_trafficmanager(self._port)
        changes = not self._lane_keepers and self._spec.traffic.lane_changes
        manager.auto_lane_change(self.ego, changes)

    @property
    def can_shift_vehicles(self) -> bool:
        """Whether the client's Traffic Manager drives beside a lane's middle: from 0.9.14 on."""
        return hasattr(carla.TrafficManager, "vehicle_lane_offset")

    def others(self) -> List[Seen]:
        """Vehicles that the Traffic Manager drives from the begin on, the ego left out."""
        return [one for one in self._vehicles if one.actor.id in self._slower]

    def shift(self, vehicle: Any, right_m: float) -> None:
        """Have a vehicle drive so far to the right of the middle of its lane."""
        manager = self._session.client.get_trafficmanager(self._port)
        manager.vehicle_lane_offset(vehicle, right_m)
        if self.is_gentle(vehicle):
            self._gently[vehicle.id].keep_aside(right_m)

    def is_gentle(self, vehicle: Any) -> bool:
        """Whether a vehicle drives with comfort: its speed is told anew ahead of each step."""
        return vehicle.id in self._gently

    def limit_speed(self, vehicle: Any, speed_m_s: Optional[float], within_m: float = 0.0) -> None:
        """Have a vehicle drive at a speed.

        Args:
            vehicle: that the Traffic Manager drives.
            speed_m_s: None: as it is planned to.
            within_m: from so far ahead of its front on, if it drives with comfort; others do so
                at once.
        """
        if self.is_gentle(vehicle):
            self._gently[vehicle.id].ask(speed_m_s, within_m)
            return
        manager = self._session.client.get_trafficmanager(self._port)
        if speed_m_s is None:
            manager.vehicle_percentage_speed_difference(vehicle, self._slower.get(vehicle.id, 0.0))
        else:
            manager.set_desired_speed(vehicle, KMH_PER_M_S * speed_m_s)

    def hand_over(self, actor: Any, velocity: Any) -> None:
        """Let the Traffic Manager drive a vehicle on from here."""
        self.commands += [
            carla.command.SetSimulatePhysics(actor.id, True),
            carla.command.ApplyTargetVelocity(actor.id, velocity),
        ]
        self.send()
        actor.set_autopilot(True, self._port)
        manager = self._session.client.get_trafficmanager(self._port)
        manager.update_vehicle_lights(actor, self._spec.weather.lights == "auto")

    def signals_after(self, place: Any, distance_m: float) -> List[Any]:
        """Traffic lights that hold for a lane within a distance after a waypoint, by id."""
        lights = self._session.world.get_traffic_lights_from_waypoint(place, distance_m)
        return sorted(lights, key=lambda light: int(light.id))

    def hold_signals(self, green: List[Any], group: List[Any]) -> HeldSignals:
        """Have lights of a junction show green, and its others red, until they are released."""
        signals = HeldSignals(green, group, self._held_signals)
        self._session.on_exit("traffic lights", signals.release)
        return signals

    def send(self) -> None:
        """Give the server what is to hold in its next step."""
        if self.commands:
            self._session.client.apply_batch(self.commands)
            self.commands = []


def _is_car(blueprint: Any) -> bool:
    """Whether a vehicle is a car, on servers before 0.9.14 too, where none has a base type."""
    if blueprint.has_attribute("base_type"):
        return bool(blueprint.get_attribute("base_type").as_str() == "car")
    wheels = blueprint.get_attribute("number_of_wheels").as_int()
    return vehicle_class(str(blueprint.id), "", two_wheels=wheels == 2) == "car"
