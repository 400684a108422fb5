"""The ego vehicle."""

from __future__ import annotations

import random
from typing import Any, Tuple

import carla

from carstage.collector.actors import dress, find_blueprint
from carstage.collector.internals.errors import SceneError
from carstage.collector.maps import spawn_points
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec


def ego_start(session: WorldSession, spec: EpisodeSpec) -> Tuple[Any, str]:
    """Where the ego begins, as ``carla.Transform`` and in words.

    Raises:
        SceneError: the map has no such spawn point.
    """
    place = spec.ego.spawn_place
    if place is not None:
        return (
            carla.Transform(
                carla.Location(place.x_m, place.y_m, place.z_m), carla.Rotation(yaw=place.yaw_deg)
            ),
            "the place (%g, %g, %g)" % (place.x_m, place.y_m, place.z_m),
        )
    points = spawn_points(session.map)
    index = spec.ego.spawn_index
    if index is None or index >= len(points):
        raise SceneError(
            "ego.spawn_index: %s, but map %s has %d spawn points." % (index, spec.map, len(points)),
            "Use 0 to %d." % (len(points) - 1),
        )
    return points[index], "spawn point %d" % index


def spawn_ego(session: WorldSession, spec: EpisodeSpec) -> Any:
    """Spawn the ego (``role_name`` hero) where it is planned; return the ``carla.Vehicle``.

    Raises:
        SceneError: no such blueprint or spawn point, or something stands there.
    """
    start, words = ego_start(session, spec)
    library = session.world.get_blueprint_library()
    blueprint = find_blueprint(library, spec.ego.blueprint, "ego.blueprint")
    dress(blueprint, random.Random(spec.seeds.ego))
    if spec.ego.color is not None and blueprint.has_attribute("color"):
        blueprint.set_attribute("color", ",".join(str(channel) for channel in spec.ego.color))
    blueprint.set_attribute("role_name", "hero")
    ego = session.try_spawn(blueprint, start)
    if ego is None:
        raise SceneError(
            "ego: %s of map %s is not free." % (words, spec.map),
            "Choose another ego.spawn; a place of your own needs to be a little above the road.",
        )
    session.destroy_on_exit("ego", ego)
    return ego
