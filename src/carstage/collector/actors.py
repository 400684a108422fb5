"""The other road users: vehicles at shuffled spawn points, walkers on the navigation mesh.

Both begin near the ego first, where its sensors can see them, and further away when the places
there run out. When all places have run out, the plan says what a shortfall means.
"""

from __future__ import annotations

import difflib
import itertools
import logging
import math
import random
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import carla

from carstage.collector.crosswalks import crossing_ways, crosswalks
from carstage.collector.internals.errors import SceneError
from carstage.collector.maps import spawn_points
from carstage.collector.sidewalks import abreast, group_sizes
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec, GroupSpec
from carstage.spec.road_users import ALL_GENERATIONS

PLACES_PER_WALKER = 40
"""So many random places are drawn for each walker; those near the ego are tried first."""
CROSSING_PLACES = 4000
"""So many are drawn to find some beside the crosswalks near the ego."""

WARN = "warn"
FILL = "fill"
FILL_ROUNDS = 5
FILL_SPACING_M = 12.0
DROP_M = 0.5
"""So far above the road vehicles are let down between the spawn points."""

EGO_SPACE_M = 1.0
"""A spawn point that near is the ego's own."""

WALKING_M_S = 1.4
RUNNING_M_S = 2.8

_log = logging.getLogger(__name__)


class Walker(NamedTuple):
    """A pedestrian, the AI controller that moves it, how fast and where it goes.

    The target is a ``carla.Location``; None: chosen when it starts. The leader is the actor id of
    whom it goes with; None: it goes alone, or leads.
    """

    actor: Any
    controller: Any
    speed_m_s: float
    target: Any = None
    leader: Optional[int] = None


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


def spawn_vehicles(session: WorldSession, spec: EpisodeSpec, start: Any) -> List[Any]:
    """Spawn the planned vehicles, as many as find a free place.

    The same seed makes the same choice: spawn points are shuffled, those within the radius of the
    ego come first, blueprints are drawn from the filter's matches in the order of their ids.

    Args:
        session: the episode's world.
        spec: the episode.
        start: ``carla.Transform`` where the ego begins.

    Raises:
        SceneError: vehicles are wanted and a filter matches no blueprint, or the shortfall that
            the plan does not allow.
    """
    plan = spec.vehicles
    rng = random.Random(spec.seeds.spawn)
    places = _vehicle_places(session, spec, start, rng)
    vehicles: List[Any] = []
    for index, group in enumerate(plan.all_groups):
        last = index == len(plan.all_groups) - 1
        path = "vehicles" if last else "vehicles.groups[%d]" % index
        blueprints = _matching(session.world, group, path, "vehicle.")
        wanted = len(vehicles) + group.count
        while len(vehicles) < wanted:
            place = next(places, None)
            if place is None:
                break
            blueprint = rng.choice(blueprints)
            dress(blueprint, rng)
            blueprint.set_attribute("role_name", "autopilot")
            vehicle = session.try_spawn(blueprint, place)
            if vehicle is not None:
                vehicles.append(vehicle)
                session.destroy_on_exit("vehicle %d" % vehicle.id, vehicle)
    _check_shortfall("vehicles", plan.total, len(vehicles), plan.shortfall)
    return vehicles


def _vehicle_places(
    session: WorldSession, spec: EpisodeSpec, start: Any, rng: random.Random
) -> Iterator[Any]:
    """Spawn points but the ego's, then, to fill up, places along the roads; near ones first."""
    radius_m, here = spec.vehicles.radius_m, start.location
    points = spawn_points(session.map)
    free = [point for point in points if point.location.distance(here) > EGO_SPACE_M]
    rng.shuffle(free)
    free.sort(key=lambda point: not _is_near(point.location, here, radius_m))
    yield from free
    if spec.vehicles.shortfall == FILL:
        between = [w.transform for w in session.map.generate_waypoints(FILL_SPACING_M)]
        rng.shuffle(between)
        between.sort(key=lambda place: not _is_near(place.location, here, radius_m))
        for place in between:
            place.location.z += DROP_M
            yield place


def spawn_walkers(session: WorldSession, spec: EpisodeSpec, start: Any) -> List[Walker]:
    """Spawn the planned walkers, each with its AI controller; nobody walks yet.

    Args:
        session: the episode's world.
        spec: the episode.
        start: ``carla.Transform`` where the ego begins.

    Raises:
        SceneError: walkers are wanted and the filter matches no blueprint, or the shortfall that
            the plan does not allow.
    """
    world, plan = session.world, spec.pedestrians
    rng = random.Random(spec.seeds.walkers)
    world.set_pedestrians_seed(spec.seeds.walkers)
    world.set_pedestrians_cross_factor(plan.crossing_percent / 100.0)
    blueprints = _matching(world, plan.group, "pedestrians", "walker.")
    grown = [one for one in blueprints if not _is(one, "age", "child")] or blueprints
    sits = random.Random("%d wheelchairs" % spec.seeds.walkers)
    walkers: List[Walker] = []
    for ways in _walker_ways(session, spec, start, walkers):
        room = plan.group.count - len(walkers)
        if not room:
            break
        together: List[Walker] = []
        for place, target in ways[:room]:
            # A child may go with somebody, and does not lead.
            blueprint = rng.choice(blueprints if together or len(ways) == 1 else grown)
            runs = rng.random() < plan.running_percent / 100.0 and len(ways) == 1
            speed_m_s = _speed_m_s(blueprint, rng, runs)
            _seat(blueprint, not runs and sits.random() < plan.wheelchair_percent / 100.0)
            walker = _spawn_walker(session, blueprint, place)
            if walker is not None:
                together.append(walker._replace(speed_m_s=speed_m_s, target=target))
        walkers += _in_step(together)
    _check_shortfall("pedestrians", plan.group.count, len(walkers), plan.shortfall)
    return walkers


def _seat(blueprint: Any, sits: bool) -> None:
    """Put who can use a wheelchair into one, or out of one; servers before 0.9.16 have none."""
    if _is(blueprint, "can_use_wheelchair", "true"):
        blueprint.set_attribute("use_wheelchair", "true" if sits else "false")


def _spawn_walker(session: WorldSession, blueprint: Any, place: Any) -> Optional[Walker]:
    """A walker and its controller; None where something is in the way."""
    world = session.world
    if blueprint.has_attribute("is_invincible"):
        blueprint.set_attribute("is_invincible", "false")
    place.z += 1.0
    actor = session.try_spawn(blueprint, carla.Transform(place))
    if actor is None:
        return None
    session.destroy_on_exit("walker %d" % actor.id, actor)
    kind = world.get_blueprint_library().find("controller.ai.walker")
    controller = world.spawn_actor(kind, carla.Transform(), actor)
    session.destroy_on_exit("controller %d" % controller.id, controller)
    return Walker(actor, controller, WALKING_M_S)


def _in_step(together: Sequence[Walker]) -> List[Walker]:
    """Who walks together is as fast as the slowest, and goes with the first."""
    speed_m_s = min((walker.speed_m_s for walker in together), default=0.0)
    return [
        walker._replace(
            speed_m_s=speed_m_s, leader=together[0].actor.id if number else walker.leader
        )
        for number, walker in enumerate(together)
    ]


def _walker_ways(
    session: WorldSession, spec: EpisodeSpec, start: Any, walkers: Sequence[Walker]
) -> Iterator[List[Tuple[Any, Any]]]:
    """Where walkers begin and where they go to, of each group or one alone.

    The share that crosses comes first, then the groups.

    Args:
        session: the episode's world.
        spec: the episode.
        start: ``carla.Transform`` where the ego begins.
        walkers: those that have a place already; grows meanwhile.
    """
    plan = spec.pedestrians
    crossing = round(plan.group.count * plan.crossing_percent / 100.0)
    if crossing:
        draw = session.world.get_random_location_from_navigation
        drawn = [place for place in (draw() for _ in range(CROSSING_PLACES)) if place is not None]
        rng = random.Random("%d crossing" % spec.seeds.walkers)
        for way in crossing_ways(crosswalks(session.map), drawn, start, rng):
            if len(walkers) == crossing:
                break
            yield [way]
    places = _walker_places(session, spec, start)
    narrow: List[Any] = []
    rng = random.Random("%d groups" % spec.seeds.walkers)
    for size in group_sizes(round(plan.group.count * plan.in_groups_percent / 100.0), rng):
        for place in places:
            beside = abreast(session.map, place, size)
            if beside:
                yield [(one, None) for one in beside]
                break
            narrow.append(place)
    for place in itertools.chain(narrow, places):
        yield [(place, None)]


def _walker_places(session: WorldSession, spec: EpisodeSpec, start: Any) -> Iterator[Any]:
    """Random places on the navigation mesh, in each round those near the ego first."""
    plan = spec.pedestrians
    for _ in range(FILL_ROUNDS if plan.shortfall == FILL else 1):
        drawn = [
            session.world.get_random_location_from_navigation()
            for _ in range(PLACES_PER_WALKER * plan.group.count)
        ]
        places = [place for place in drawn if place is not None]
        if len(places) < len(drawn):
            _log.warning("map %s has no navigation mesh: no pedestrians", spec.map)
        places.sort(key=lambda place: not _is_near(place, start.location, plan.radius_m))
        yield from places


def _is_near(place: Any, here: Any, radius_m: Optional[float]) -> bool:
    return radius_m is None or math.hypot(place.x - here.x, place.y - here.y) <= radius_m


def start_walkers(session: WorldSession, walkers: List[Walker]) -> None:
    """Send the walkers on their ways; they must have been in a tick before."""
    targets: Dict[int, Any] = {}
    for walker in walkers:
        walker.controller.start()
        session.on_exit("controller %d" % walker.controller.id, walker.controller.stop)
        target = walker.target
        if walker.leader is not None:
            target = targets.get(walker.leader)
        target = target or session.world.get_random_location_from_navigation()
        targets[walker.actor.id] = target
        if target is not None:
            walker.controller.go_to_location(target)
        walker.controller.set_max_speed(walker.speed_m_s)


def _speed_m_s(blueprint: Any, rng: random.Random, runs: bool) -> float:
    """A random speed for each walker around what its blueprint recommends.

    CARLA's walkers recommend three speeds: standing, walking, running.
    """
    speeds = [WALKING_M_S, WALKING_M_S, RUNNING_M_S]
    if blueprint.has_attribute("speed"):
        recommended = [float(text) for text in blueprint.get_attribute("speed").recommended_values]
        speeds = recommended if len(recommended) == len(speeds) else speeds
    return speeds[2 if runs else 1] * rng.uniform(0.8, 1.2)


def _matching(world: Any, group: GroupSpec, path: str, family: str) -> List[Any]:
    """The blueprints of a family that a group's filter, class and generation leave, by id."""
    library = world.get_blueprint_library().filter(group.filter)
    generation = None if group.generation == ALL_GENERATIONS else group.generation
    wanted = {"base_type": group.base_type, "generation": generation}
    blueprints = sorted(
        (
            blueprint
            for blueprint in library
            if str(blueprint.id).startswith(family)
            and all(value is None or _is(blueprint, name, value) for name, value in wanted.items())
        ),
        key=lambda blueprint: str(blueprint.id),
    )
    if group.count and not blueprints:
        asked = ["%s %s" % (name, value) for name, value in wanted.items() if value is not None]
        raise SceneError(
            "%s.filter: no blueprint of the server matches %r%s."
            % (path, group.filter, "".join(" with " + words for words in asked)),
            "Use a pattern such as vehicle.* or walker.pedestrian.*.",
        )
    return blueprints


def _is(blueprint: Any, name: str, value: str) -> bool:
    """Whether an attribute has a value; case does not matter, servers differ in it."""
    if not blueprint.has_attribute(name):
        return False
    attribute = blueprint.get_attribute(name)
    if attribute.type == carla.ActorAttributeType.Int:
        return str(attribute.as_int()) == value
    if attribute.type == carla.ActorAttributeType.Bool:
        return bool(attribute.as_bool()) == (value == "true")
    return str(attribute.as_str()).lower() == value.lower()


def _check_shortfall(what: str, wanted: int, got: int, policy: str) -> None:
    if got >= wanted:
        return
    sentence = "only %d of %d %s found a free place" % (got, wanted, what)
    if policy == WARN:
        _log.warning("%s", sentence)
        return
    raise SceneError(
        "%s.count: %s." % (what, sentence),
        "Ask for fewer, widen %s.radius_m or the filter, or set %s.shortfall to warn."
        % (what, what),
    )
