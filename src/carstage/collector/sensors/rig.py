"""The rig: sensors spawned on their carriers, listened to, moved along, and given back."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any, Callable, Dict, List, Mapping, Optional, Tuple

import carla

from carstage.collector.actors import find_blueprint
from carstage.collector.internals.dialect import attachment_type, is_listening
from carstage.collector.internals.errors import SceneError
from carstage.collector.sensors import sensor_of
from carstage.collector.sensors.carriers import Carriers
from carstage.collector.world import WorldSession
from carstage.spec import FOLLOW, EpisodeSpec, SensorSpec

MAX_NOISE_SEED = 2**31 - 1
"""``noise_seed`` is an int attribute on the server."""


_ATTACHMENTS = {"spring_arm": "SpringArm", "spring_arm_ghost": "SpringArmGhost"}


class Rig:
    """All sensors of an episode, hidden twins too.

    Args:
        session: the episode's world; the sensors are destroyed before it is given back.
        spec: the episode.
        ego: what carries them: the ego's ``carla.Vehicle``, or an agent's actor.
        path: in front of ``sensors`` where errors name one.
        intervals_s: by sensor, simulated time between measurements, of those that do not measure
            in every step.

    Raises:
        SceneError: unknown blueprint, attribute or attachment, or nothing to attach to.
    """

    def __init__(
        self,
        session: WorldSession,
        spec: EpisodeSpec,
        ego: Any,
        path: str = "",
        intervals_s: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self._session = session
        library = session.world.get_blueprint_library()
        carriers = Carriers(session.world, ego)
        self.actors: Dict[str, Any] = {}
        self.carrier_ids: Dict[str, int] = {}
        self.expected_bytes: Dict[str, int] = {}
        self._followers: List[Tuple[Any, Any, SensorSpec]] = []
        self._watchers: Mapping[str, Callable[[Any], None]] = {}
        for index, sensor in enumerate(spec.sensors):
            place = "%ssensors[%d]" % (path, index)
            blueprint = find_blueprint(library, sensor.blueprint, place + ".blueprint")
            for name, value in _attributes(blueprint, sensor, spec, index, place):
                blueprint.set_attribute(name, value)
            if sensor.id in intervals_s:
                blueprint.set_attribute("sensor_tick", repr(intervals_s[sensor.id]))
            carrier = carriers.carrier_of(sensor, place)
            actor = self._spawn(blueprint, sensor, carrier, place)
            session.destroy_on_exit("sensor %s" % sensor.id, actor)
            self.actors[sensor.id] = actor
            self.carrier_ids[sensor.id] = 0 if carrier is None else int(carrier.id)
            self.expected_bytes[sensor.id] = sensor_of(sensor.kind).expected_bytes(
                dict(actor.attributes), spec.fps
            )

    def _spawn(self, blueprint: Any, sensor: SensorSpec, carrier: Optional[Any], path: str) -> Any:
        world = self._session.world
        if carrier is None:
            return world.spawn_actor(blueprint, _transform(sensor))
        if sensor.attachment == FOLLOW:
            actor = world.spawn_actor(blueprint, _above(carrier, sensor))
            self._followers.append((actor, carrier, sensor))
            return actor
        name = _ATTACHMENTS.get(sensor.attachment, "Rigid")
        kind = attachment_type(name)
        if kind is None:
            raise SceneError(
                "%s.attachment: this CARLA client has no %s." % (path, name), "Use rigid or follow."
            )
        return world.spawn_actor(blueprint, _transform(sensor), carrier, kind)

    def move_followers(self) -> None:
        """Bring the sensors that hover over their carriers to where those were last seen."""
        if self._followers:
            self._session.client.apply_batch(
                [
                    carla.command.ApplyTransform(actor.id, _above(carrier, sensor))
                    for actor, carrier, sensor in self._followers
                ]
            )

    def watch(self, watchers: Mapping[str, Callable[[Any], None]]) -> None:
        """Have the data of some sensors given to somebody else too, once they are listened to."""
        self._watchers = watchers

    def listen(self, callbacks: Mapping[str, Callable[[Any], None]]) -> None:
        """Listen to those sensors, in the plan's order; stopped before anything is destroyed."""
        for sensor_id, actor in self.actors.items():
            if sensor_id not in callbacks:
                continue
            watcher = self._watchers.get(sensor_id)
            record = callbacks[sensor_id]
            actor.listen(record if watcher is None else _both(record, watcher))

    def stop(self) -> None:
        """Stop listening; stopping what never listened does nothing."""
        for actor in self.actors.values():
            if is_listening(actor):
                actor.stop()


def _both(first: Callable[[Any], None], second: Callable[[Any], None]) -> Callable[[Any], None]:
    def give(data: Any) -> None:
        first(data)
        second(data)

    return give


def _attributes(
    blueprint: Any, sensor: SensorSpec, spec: EpisodeSpec, index: int, place: str
) -> List[Tuple[str, str]]:
    """Every step and a seed where the blueprint has them, then the plan's own values.

    ``sensor_tick`` 0 means every step: other values drift, so that lower rates are made by saving
    every n-th step wherever sensors shall be in step.
    """
    seed = (spec.seeds.sensor_noise + index) % MAX_NOISE_SEED
    defaults = {"sensor_tick": "0.0", "noise_seed": str(seed)}
    chosen = {name: value for name, value in defaults.items() if blueprint.has_attribute(name)}
    for name, value in sensor.attributes.items():
        if not blueprint.has_attribute(name):
            raise SceneError(
                "%s.attributes: %s has no attribute %r." % (place, sensor.blueprint, name),
                "It has: %s." % ", ".join(sorted(attribute.id for attribute in blueprint)),
            )
        chosen[name] = value
    return sorted(chosen.items())


def _transform(sensor: SensorSpec) -> Any:
    pose = sensor.pose
    return carla.Transform(
        carla.Location(pose.x_m, pose.y_m, pose.z_m),
        carla.Rotation(pitch=pose.pitch_deg, yaw=pose.yaw_deg, roll=pose.roll_deg),
    )


def _above(carrier: Any, sensor: SensorSpec) -> Any:
    """The pose of a sensor that follows: the carrier's place, the map's axes."""
    transform = _transform(sensor)
    transform.location += carrier.get_transform().location
    return transform
