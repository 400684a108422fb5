"""Agents beside the ego: spawned after it, each where it is planned."""

from __future__ import annotations

import random
from typing import Any, Dict, Iterator, List, NamedTuple, Tuple

import carla

from carstage.collector.actors import EGO_SPACE_M, dress, find_blueprint
from carstage.collector.drones import first_transform
from carstage.collector.internals.errors import SceneError
from carstage.collector.junctions import junction_transform
from carstage.collector.maps import spawn_points
from carstage.collector.world import WorldSession
from carstage.spec import CARRIER_BLUEPRINT, AgentSpec, EgoSpec, EpisodeSpec


class Agent(NamedTuple):
    """An agent as it was planned, and the actor that carries its sensors."""

    spec: AgentSpec
    actor: Any


def spawn_agents(session: WorldSession, spec: EpisodeSpec, start: Any) -> Tuple[Agent, ...]:
    """Spawn the planned agents, in their order.

    Args:
        session: the episode's world.
        spec: the episode.
        start: ``carla.Transform`` where the ego begins.

    Raises:
        SceneError: the server lacks what is planned, or a place is not free.
    """
    taken = [start.location]
    agents = []
    for index, agent in enumerate(spec.agents):
        path = "agents[%d]" % index
        if agent.vehicle is not None:
            actor = _spawn_vehicle(session, agent, agent.vehicle, taken, path)
        else:
            place = _carrier_place(session, agent, spec.step_s, start, path)
            actor = _spawn_carrier(session, place)
        session.destroy_on_exit("agent %s" % agent.name, actor)
        agents.append(Agent(agent, actor))
    return tuple(agents)


def _carrier_place(
    session: WorldSession, agent: AgentSpec, step_s: float, start: Any, path: str
) -> Any:
    """``carla.Transform`` where the sensors of an agent that is no vehicle begin.

    Raises:
        SceneError: the map has no such junction.
    """
    if agent.drone is not None:
        return first_transform(agent.drone, step_s, start)
    if agent.junction is not None:
        return junction_transform(session.map, agent.junction, start, path)
    pose = agent.pose
    assert pose is not None
    return carla.Transform(
        carla.Location(pose.x_m, pose.y_m, pose.z_m),
        carla.Rotation(pitch=pose.pitch_deg, yaw=pose.yaw_deg, roll=pose.roll_deg),
    )


def _spawn_carrier(session: WorldSession, place: Any) -> Any:
    """What the sensors of an agent that is no vehicle hang on."""
    library = session.world.get_blueprint_library()
    return session.world.spawn_actor(find_blueprint(library, CARRIER_BLUEPRINT, "agents"), place)


def _spawn_vehicle(
    session: WorldSession, agent: AgentSpec, vehicle: EgoSpec, taken: List[Any], path: str
) -> Any:
    """Spawn a vehicle at the first of its places that is free; note that it is taken.

    Raises:
        SceneError: none is.
    """
    library = session.world.get_blueprint_library()
    blueprint = find_blueprint(library, vehicle.blueprint, path + ".blueprint")
    dress(blueprint, random.Random(agent.seeds.looks))
    if vehicle.color is not None and blueprint.has_attribute("color"):
        blueprint.set_attribute("color", ",".join(str(channel) for channel in vehicle.color))
    blueprint.set_attribute("role_name", agent.name)
    for place in _places(session, vehicle, taken, path):
        actor = session.try_spawn(blueprint, place)
        if actor is not None:
            taken.append(place.location)
            return actor
    raise SceneError(
        "%s.spawn: there is no free place for agent %s." % (path, agent.name),
        "Choose another spawn; a place of your own needs to be a little above the road.",
    )


def _places(session: WorldSession, vehicle: EgoSpec, taken: List[Any], path: str) -> Iterator[Any]:
    """Where a vehicle may begin, ``carla.Transform``, the best place first."""
    place = vehicle.spawn_place
    if place is not None:
        yield carla.Transform(
            carla.Location(place.x_m, place.y_m, place.z_m), carla.Rotation(yaw=place.yaw_deg)
        )
        return
    points = spawn_points(session.map)
    if vehicle.near_ego:
        yield from _nearest(points, taken)
        return
    index = vehicle.spawn_index
    if index is None or index >= len(points):
        raise SceneError(
            "%s.spawn: the map has no spawn point %s." % (path, index),
            "Use 0 to %d, or `near_ego`." % (len(points) - 1),
        )
    yield points[index]


def _nearest(points: List[Any], taken: List[Any]) -> List[Any]:
    """Spawn points, the nearest to the ego first, without those that somebody has begun at."""
    here = taken[0]
    free = [
        point
        for point in points
        if all(point.location.distance(other) > EGO_SPACE_M for other in taken)
    ]
    distance: Dict[int, float] = {id(point): point.location.distance(here) for point in free}
    return sorted(free, key=lambda point: distance[id(point)])
