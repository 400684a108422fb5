"""The rig: sensors spawned on the ego, listened to, and given back."""

from __future__ import annotations

from typing import Any, Callable, Dict, List, Mapping, Tuple

import carla

from carstage.collector.actors import find_blueprint
from carstage.collector.errors import SceneError
from carstage.collector.plan import EpisodeSpec, SensorPlan
from carstage.collector.sensors import SENSOR_KINDS
from carstage.collector.world import WorldSession

MAX_NOISE_SEED = 2**31 - 1
"""``noise_seed`` is an int attribute on the server."""


class Rig:
    """All sensors of an episode, hidden twins too, rigidly attached to the ego.

    Args:
        session: the episode's world; the sensors are destroyed before it is given back.
        spec: the episode.
        ego: the ego's ``carla.Vehicle``.

    Raises:
        SceneError: unknown blueprint or attribute.
    """

    def __init__(self, session: WorldSession, spec: EpisodeSpec, ego: Any) -> None:
        self._session = session
        library = session.world.get_blueprint_library()
        self.actors: Dict[str, Any] = {}
        self.expected_bytes: Dict[str, int] = {}
        for index, sensor in enumerate(spec.sensors):
            blueprint = find_blueprint(library, sensor.blueprint, "sensors[%d].blueprint" % index)
            for name, value in _attributes(blueprint, sensor, spec, index):
                blueprint.set_attribute(name, value)
            actor = session.world.spawn_actor(
                blueprint, _transform(sensor), ego, carla.AttachmentType.Rigid
            )
            session.destroy_on_exit("sensor %s" % sensor.id, actor)
            self.actors[sensor.id] = actor
            self.expected_bytes[sensor.id] = SENSOR_KINDS[sensor.kind].expected_bytes(
                dict(actor.attributes), spec.fps
            )

    def listen(self, callbacks: Mapping[str, Callable[[Any], None]]) -> None:
        """Listen to every sensor, in the plan's order; stopped before anything is destroyed."""
        for sensor_id, actor in self.actors.items():
            actor.listen(callbacks[sensor_id])

    def stop(self) -> None:
        """Stop listening; stopping what never listened does nothing."""
        for actor in self.actors.values():
            if actor.is_listening:
                actor.stop()


def _attributes(
    blueprint: Any, sensor: SensorPlan, spec: EpisodeSpec, index: int
) -> List[Tuple[str, str]]:
    """Our defaults where the blueprint has them, then the plan's own values."""
    path = "sensors[%d].attributes" % index
    defaults = SENSOR_KINDS[sensor.kind].defaults(spec.fps)
    seed = (spec.seeds["sensor_noise"] + index) % MAX_NOISE_SEED
    defaults["noise_seed"] = str(seed)
    chosen = {name: value for name, value in defaults.items() if blueprint.has_attribute(name)}
    for name, value in sensor.attributes.items():
        if not blueprint.has_attribute(name):
            raise SceneError(
                "%s: %s has no attribute %r." % (path, sensor.blueprint, name),
                "It has: %s." % ", ".join(sorted(attribute.id for attribute in blueprint)),
            )
        chosen[name] = value
    return sorted(chosen.items())


def _transform(sensor: SensorPlan) -> Any:
    pose = sensor.pose
    return carla.Transform(
        carla.Location(pose.x_m, pose.y_m, pose.z_m),
        carla.Rotation(pitch=pose.pitch_deg, yaw=pose.yaw_deg, roll=pose.roll_deg),
    )
