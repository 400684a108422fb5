"""The world's state of one tick as a record: actors, weather, ego, lights."""

from __future__ import annotations

from functools import lru_cache, partial
from operator import attrgetter
from types import MappingProxyType
from typing import (
    AbstractSet,
    Any,
    Callable,
    Dict,
    FrozenSet,
    Iterable,
    List,
    Mapping,
    Optional,
    Sequence,
    Set,
    Tuple,
)

from carstage.rawlog.format import ACTOR_RECORD

WEATHER_PARAMETERS = (
    "cloudiness",
    "precipitation",
    "precipitation_deposits",
    "wind_intensity",
    "sun_azimuth_angle",
    "sun_altitude_angle",
    "fog_density",
    "fog_distance",
    "fog_falloff",
    "wetness",
    "scattering_intensity",
    "mie_scattering_scale",
    "rayleigh_scattering_scale",
    "dust_storm",
)

_FIXED = "traffic."
"""Signs and lights: nothing moves them but a program that puts them elsewhere."""
_WITH_BOX = ("vehicle.", "walker.", "traffic.", "static.")
_actor_id = attrgetter("id")


class WorldMoment:
    """One tick's truth, taken in the main thread and encoded in a writer's.

    The snapshot is the client's own frozen state of that frame: reading it later gives the same.

    Args:
        snapshot: ``carla.WorldSnapshot``.
        meta: the record's meta; see docs/formats/raw-log.md. A function stands for what it returns:
            it is called by who writes, not by who ticks.
        new_actors: table rows of actors that no earlier tick showed.
        level_objects: table rows of the level; of the first tick only.
        packer: of this tick's world and the others'.
        fixed: ids of actors that have no velocity.
    """

    def __init__(
        self,
        snapshot: Any,
        meta: Mapping[str, Any],
        new_actors: Sequence[Mapping[str, Any]],
        level_objects: Sequence[Mapping[str, Any]] = (),
        packer: Optional[ActorPacker] = None,
        fixed: AbstractSet[int] = frozenset(),
    ) -> None:
        self.snapshot = snapshot
        self.meta = meta
        self.new_actors = new_actors
        self.level_objects = level_objects
        self._packer = packer or ActorPacker()
        self._fixed = fixed

    def table(self) -> Optional[Dict[str, Any]]:
        """Meta of the table record that goes before this tick's; None: nothing is new."""
        if not self.new_actors and not self.level_objects:
            return None
        table: Dict[str, Any] = {"actors": list(self.new_actors)}
        if self.level_objects:
            table["level_objects"] = list(self.level_objects)
        return table

    def encode(self) -> Tuple[Mapping[str, Any], bytes]:
        """Meta and payload of the world record."""
        meta = {name: value() if callable(value) else value for name, value in self.meta.items()}
        return meta, self._packer.pack(self.snapshot, self._fixed)


class ActorPacker:
    """Packs the actors of snapshots, from one thread.

    Asking ``carla`` for each number takes the most time of a tick. So who is known to move by no
    physics is packed again only where its transform is another one.
    """

    def __init__(self) -> None:
        self._fixed: Dict[int, Tuple[Any, bytes]] = {}

    def pack(self, snapshot: Any, fixed: AbstractSet[int] = frozenset()) -> bytes:
        """Pack every actor of a ``carla.WorldSnapshot``, ascending id.

        Args:
            snapshot: of any tick.
            fixed: ids of actors that have no velocity.
        """
        packed, known = {}, self._fixed
        for actor in snapshot:
            actor_id, transform = actor.id, actor.get_transform()
            if actor_id in fixed:
                before = known.get(actor_id)
                if before is None or before[0] != transform:
                    before = known[actor_id] = transform, _packed(actor_id, transform, actor)
                packed[actor_id] = before[1]
            else:
                packed[actor_id] = _packed(actor_id, transform, actor)
        return b"".join([packed[actor_id] for actor_id in sorted(packed)])


def _packed(actor_id: int, transform: Any, actor: Any) -> bytes:
    location, rotation = transform.location, transform.rotation
    velocity = actor.get_velocity()
    angular = actor.get_angular_velocity()
    acceleration = actor.get_acceleration()
    return ACTOR_RECORD.pack(
        actor_id,
        0,
        location.x,
        location.y,
        location.z,
        rotation.pitch,
        rotation.yaw,
        rotation.roll,
        velocity.x,
        velocity.y,
        velocity.z,
        angular.x,
        angular.y,
        angular.z,
        acceleration.x,
        acceleration.y,
        acceleration.z,
    )


class WorldObserver:
    """Reads the world after each tick, in the main thread.

    Args:
        world: ``carla.World``.
        ego: the ego's ``carla.Vehicle``.
        level_objects: what the level holds, noted with the first tick.
        agents: ``carla.Vehicle`` of each further agent that has one, by its name.
    """

    def __init__(
        self,
        world: Any,
        ego: Any,
        level_objects: Sequence[Mapping[str, Any]] = (),
        agents: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self._world = world
        self._ego = ego
        self._agents = agents
        self._level_objects = level_objects
        self._known: Set[int] = set()
        self._fixed: FrozenSet[int] = frozenset()
        self._packer = ActorPacker()
        self._traffic_lights: Tuple[Tuple[str, ...], Tuple[Callable[[], Any], ...]] = (), ()

    def observe(
        self,
        snapshot: Any,
        weather: Mapping[str, float],
        events: Optional[Sequence[Mapping[str, Any]]] = None,
        command: Optional[Sequence[Any]] = None,
        agents: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
    ) -> WorldMoment:
        """Take the truth of the tick that ``snapshot`` belongs to, before the next one.

        Args:
            snapshot: ``carla.WorldSnapshot``.
            weather: the values that the tick was made with.
            events: how the planned events stood; None: none are planned.
            command: what the ego's driver commanded, as ``Command``; None: it has none of its own.
            agents: of each further agent by name, what is noted of it: ``driver``, likewise, and
                ``motion`` of a drone.
        """
        new_actors = self._new_actors(snapshot)
        states = self.states()
        if events is not None:
            states["events"] = list(events)
        if command is not None:
            states["driver"] = list(command)
        if agents:
            states["agents"] = {
                name: {**self._vehicle_of(name), **noted} for name, noted in agents.items()
            }
        lights = partial(_light_numbers, self._world.get_vehicles_light_states())
        return self._moment(snapshot, weather, new_actors, states, lights)

    def watch_lights(self, lights: Iterable[Any]) -> None:
        """Have the states of traffic lights noted from now on."""
        names, states = self._traffic_lights
        new = [light for light in lights if str(light.id) not in names]
        new.sort(key=lambda one: int(one.id))
        # A new pair: another thread may be reading the states of the old one.
        self._traffic_lights = (
            names + tuple(str(light.id) for light in new),
            states + tuple(light.get_state for light in new),
        )

    def show_level(self, level_objects: Sequence[Mapping[str, Any]]) -> None:
        """Have what the level holds noted with the next tick."""
        self._level_objects = level_objects

    def states(self) -> Dict[str, Any]:
        """What the client knows of the ego and the traffic lights in its newest frame.

        Nothing is asked of the server. Names are looked up by who writes.
        """
        names, states = self._traffic_lights
        return {
            "ego": _vehicle_state(self._ego),
            "traffic_lights": partial(_state_names, names, [state() for state in states]),
        }

    def _vehicle_of(self, name: str) -> Dict[str, Any]:
        """What the client knows of an agent's vehicle, as of the ego; nothing where it has none."""
        return {"ego": _vehicle_state(self._agents[name])()} if name in self._agents else {}

    def vehicle_lights(self) -> Dict[str, int]:
        """Ask the server which lights of which vehicles are on, by actor id."""
        return _light_numbers(self._world.get_vehicles_light_states())

    def observe_past(
        self,
        snapshot: Any,
        weather: Mapping[str, float],
        states: Mapping[str, Any],
        vehicle_lights: Mapping[str, int],
    ) -> WorldMoment:
        """Take the truth of a tick after which others may have been made.

        Args:
            snapshot: ``carla.WorldSnapshot``.
            weather, vehicle_lights: as far as they are known.
            states: what :meth:`states` gave while this frame was the newest.
        """
        new_actors = self._new_actors(snapshot)
        return self._moment(snapshot, weather, new_actors, states, vehicle_lights)

    def _moment(
        self,
        snapshot: Any,
        weather: Mapping[str, float],
        new_actors: Sequence[Mapping[str, Any]],
        states: Mapping[str, Any],
        vehicle_lights: Any,
    ) -> WorldMoment:
        meta = {
            "delta_s": snapshot.timestamp.delta_seconds,
            "weather": weather,
            "ego": states["ego"],
            "vehicle_lights": vehicle_lights,
            "traffic_lights": states["traffic_lights"],
        }
        meta.update(
            {name: states[name] for name in ("events", "driver", "agents") if name in states}
        )
        level_objects, self._level_objects = self._level_objects, ()
        return WorldMoment(snapshot, meta, new_actors, level_objects, self._packer, self._fixed)

    def _new_actors(self, snapshot: Any) -> List[Dict[str, Any]]:
        # In each tick: without an object of Python's for what is known.
        if self._known.issuperset(map(_actor_id, snapshot)):
            return []
        new = sorted(set(map(_actor_id, snapshot)) - self._known)
        self._known.update(new)
        actors = sorted(self._world.get_actors(new), key=lambda actor: int(actor.id))
        self.watch_lights(actor for actor in actors if actor.type_id == "traffic.traffic_light")
        self._fixed |= {actor.id for actor in actors if actor.type_id.startswith(_FIXED)}
        return [actor_row(actor) for actor in actors]


def _vehicle_state(vehicle: Any) -> Callable[[], Dict[str, Any]]:
    """What the client knows of a ``carla.Vehicle`` in its newest frame, beside its place.

    It is asked now; the function puts it into words later.
    """
    return partial(
        _vehicle_row,
        vehicle.id,
        vehicle.get_control(),
        vehicle.get_speed_limit(),
        vehicle.get_traffic_light_state(),
    )


def _vehicle_row(
    actor_id: int, control: Any, speed_limit_kmh: float, light_state: Any
) -> Dict[str, Any]:
    return {
        "id": actor_id,
        "throttle": control.throttle,
        "steer": control.steer,
        "brake": control.brake,
        "hand_brake": control.hand_brake,
        "reverse": control.reverse,
        "gear": control.gear,
        "speed_limit_kmh": speed_limit_kmh,
        "traffic_light_state": _state_name(light_state),
    }


def _state_names(lights: Sequence[str], states: Sequence[Any]) -> Dict[str, str]:
    """The states of traffic lights, by id."""
    return dict(zip(lights, map(_state_name, states)))


def _light_numbers(states: Mapping[Any, Any]) -> Dict[str, int]:
    """Which lights are on, by the vehicle's id, of ``World.get_vehicles_light_states``."""
    return {str(actor_id): int(state) for actor_id, state in states.items()}


@lru_cache(maxsize=None)
def _state_name(state: Any) -> str:
    """Of a ``carla.TrafficLightState``; there are five."""
    return str(state)


def actor_row(actor: Any) -> Dict[str, Any]:
    """What is static about a ``carla.Actor``: one row of a world table."""
    return {
        "id": actor.id,
        "type_id": actor.type_id,
        "parent": actor.parent.id if actor.parent is not None else 0,
        "attributes": dict(actor.attributes),
        "semantic_tags": [int(tag) for tag in actor.semantic_tags],
        "box": _box(actor),
    }


def _box(actor: Any) -> Dict[str, List[float]]:
    # Asking for the box of a sensor or a controller is a call to the server that may fail there.
    if not actor.type_id.startswith(_WITH_BOX):
        return {"location": [0.0] * 3, "extent": [0.0] * 3, "rotation_deg": [0.0] * 3}
    box = actor.bounding_box
    rotation = box.rotation
    return {
        "location": [box.location.x, box.location.y, box.location.z],
        "extent": [box.extent.x, box.extent.y, box.extent.z],
        "rotation_deg": [rotation.pitch, rotation.yaw, rotation.roll],
    }
