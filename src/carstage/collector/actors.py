"""The other road users: vehicles at shuffled spawn points, walkers on the navigation mesh.

Both begin near the ego first, where its sensors can see them, and further away when the places
there run out.
"""

from __future__ import annotations

import difflib
import logging
import math
import random
from typing import Any, List, NamedTuple, Optional

import carla

from carstage.collector.errors import SceneError
from carstage.collector.maps import spawn_points
from carstage.collector.plan import CrowdPlan, EpisodeSpec
from carstage.collector.world import WorldSession

PLACES_PER_WALKER = 40
"""So many random places are drawn for each walker; those near the ego are tried first."""

_log = logging.getLogger(__name__)


class Walker(NamedTuple):
    """A pedestrian and the AI controller that moves it."""

    actor: Any
    controller: Any


def find_blueprint(library: Any, name: str, path: str) -> Any:
    """The blueprint of that very id.

    Raises:
        SceneError: the server has none; names the nearest.
    """
    known = sorted(blueprint.id for blueprint in library)
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        raise SceneError(
            "%s: the server has no blueprint %r." % (path, name),
            "Did you mean %s?" % near[0] if near else "See its blueprint library.",
        )
    return library.find(name)


def dress(blueprint: Any, rng: random.Random) -> None:
    """Choose among the recommended looks (colour, driver)."""
    for name in ("color", "driver_id"):
        if blueprint.has_attribute(name):
            values = list(blueprint.get_attribute(name).recommended_values)
            if values:
                blueprint.set_attribute(name, rng.choice(values))


def spawn_vehicles(session: WorldSession, spec: EpisodeSpec) -> List[Any]:
    """Spawn the planned vehicles, as many as find a free spawn point.

    The same seed makes the same choice: spawn points are shuffled, those within the radius of the
    ego come first, blueprints are drawn from the filter's matches in the order of their ids.

    Raises:
        SceneError: vehicles are wanted and the filter matches no blueprint.
    """
    rng = random.Random(spec.seeds["spawn"])
    points = spawn_points(session.map)
    free = [point for index, point in enumerate(points) if index != spec.ego_spawn_index]
    rng.shuffle(free)
    ego = points[spec.ego_spawn_index].location
    free.sort(key=lambda point: not _is_near(point.location, ego, spec.vehicles.radius_m))
    blueprints = _matching(session.world, spec.vehicles, "vehicles", "vehicle.")
    vehicles: List[Any] = []
    for point in free:
        if len(vehicles) == spec.vehicles.count:
            break
        blueprint = rng.choice(blueprints)
        dress(blueprint, rng)
        blueprint.set_attribute("role_name", "autopilot")
        vehicle = session.world.try_spawn_actor(blueprint, point)
        if vehicle is not None:
            vehicles.append(vehicle)
            session.destroy_on_exit("vehicle %d" % vehicle.id, vehicle)
    _report_shortfall("vehicles", spec.vehicles.count, len(vehicles))
    return vehicles


def spawn_walkers(session: WorldSession, spec: EpisodeSpec) -> List[Walker]:
    """Spawn the planned walkers, each with its AI controller; nobody walks yet.

    Raises:
        SceneError: walkers are wanted and the filter matches no blueprint.
    """
    world = session.world
    count = spec.pedestrians.count
    rng = random.Random(spec.seeds["walkers"])
    world.set_pedestrians_seed(spec.seeds["walkers"])
    blueprints = _matching(world, spec.pedestrians, "pedestrians", "walker.")
    controller_blueprint = world.get_blueprint_library().find("controller.ai.walker")
    walkers: List[Walker] = []
    for place in _walker_places(session, spec):
        if len(walkers) == count:
            break
        blueprint = rng.choice(blueprints)
        if blueprint.has_attribute("is_invincible"):
            blueprint.set_attribute("is_invincible", "false")
        place.z += 1.0
        actor = world.try_spawn_actor(blueprint, carla.Transform(place))
        if actor is None:
            continue
        session.destroy_on_exit("walker %d" % actor.id, actor)
        controller = world.spawn_actor(controller_blueprint, carla.Transform(), actor)
        session.destroy_on_exit("controller %d" % controller.id, controller)
        walkers.append(Walker(actor, controller))
    _report_shortfall("pedestrians", count, len(walkers))
    return walkers


def _walker_places(session: WorldSession, spec: EpisodeSpec) -> List[Any]:
    """Random places on the navigation mesh, those near the ego first."""
    ego = spawn_points(session.map)[spec.ego_spawn_index].location
    drawn = [
        session.world.get_random_location_from_navigation()
        for _ in range(PLACES_PER_WALKER * spec.pedestrians.count)
    ]
    places = [place for place in drawn if place is not None]
    if len(places) < len(drawn):
        _log.warning("map %s has no navigation mesh: no pedestrians", spec.map)
    places.sort(key=lambda place: not _is_near(place, ego, spec.pedestrians.radius_m))
    return places


def _is_near(place: Any, ego: Any, radius_m: Optional[float]) -> bool:
    return radius_m is None or math.hypot(place.x - ego.x, place.y - ego.y) <= radius_m


def start_walkers(session: WorldSession, walkers: List[Walker], spec: EpisodeSpec) -> None:
    """Send the walkers on their ways; they must have been in a tick before."""
    rng = random.Random(spec.seeds["walkers"])
    for walker in walkers:
        walker.controller.start()
        session.on_exit("controller %d" % walker.controller.id, walker.controller.stop)
        target = session.world.get_random_location_from_navigation()
        if target is not None:
            walker.controller.go_to_location(target)
        walker.controller.set_max_speed(_walking_speed(walker.actor, rng))


def _walking_speed(actor: Any, rng: random.Random) -> float:
    """A speed of its own for each walker, m/s, around the one that its blueprint recommends."""
    try:
        recommended = float(actor.attributes.get("speed", ""))
    except ValueError:
        recommended = 1.4
    return recommended * rng.uniform(0.8, 1.2)


def _matching(world: Any, crowd: CrowdPlan, path: str, family: str) -> List[Any]:
    """The blueprints of a family that the crowd's filter matches, by id."""
    library = world.get_blueprint_library().filter(crowd.filter)
    blueprints = sorted(
        (blueprint for blueprint in library if str(blueprint.id).startswith(family)),
        key=lambda blueprint: str(blueprint.id),
    )
    if crowd.count and not blueprints:
        raise SceneError(
            "%s.filter: no blueprint of the server matches %r." % (path, crowd.filter),
            "Use a pattern such as vehicle.* or walker.pedestrian.*.",
        )
    return blueprints


def _report_shortfall(what: str, wanted: int, got: int) -> None:
    if got < wanted:
        _log.warning("only %d of %d %s found a free place", got, wanted, what)
