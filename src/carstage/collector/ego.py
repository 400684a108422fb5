"""The ego vehicle."""

from __future__ import annotations

import random
from typing import Any

from carstage.collector.actors import dress, find_blueprint
from carstage.collector.errors import SceneError
from carstage.collector.maps import spawn_points
from carstage.collector.plan import EpisodeSpec
from carstage.collector.world import WorldSession


def spawn_ego(session: WorldSession, spec: EpisodeSpec) -> Any:
    """Spawn the ego (``role_name`` hero) at its planned spawn point; return the ``carla.Vehicle``.

    Raises:
        SceneError: no such blueprint or spawn point, or something stands there.
    """
    points = spawn_points(session.map)
    if spec.ego_spawn_index >= len(points):
        raise SceneError(
            "ego.spawn_index: %d, but map %s has %d spawn points."
            % (spec.ego_spawn_index, spec.map, len(points)),
            "Use 0 to %d." % (len(points) - 1),
        )
    library = session.world.get_blueprint_library()
    blueprint = find_blueprint(library, spec.ego_blueprint, "ego.blueprint")
    dress(blueprint, random.Random(spec.seeds["ego"]))
    blueprint.set_attribute("role_name", "hero")
    ego = session.world.try_spawn_actor(blueprint, points[spec.ego_spawn_index])
    if ego is None:
        raise SceneError(
            "ego: spawn point %d of map %s is not free." % (spec.ego_spawn_index, spec.map),
            "Choose another ego.spawn_index.",
        )
    session.destroy_on_exit("ego", ego)
    return ego
