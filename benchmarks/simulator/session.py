"""A client's session with a server: synchronous mode, one Traffic Manager, seeded spawning.

The order of calls here is the one that makes a run repeatable. A server that nobody has claimed yet
runs free, so that its frame number and its lights depend on when the client came: synchronous mode
first, then a new episode in which frames, time, actor ids and lights start over, then the Traffic
Manager with its seed, then a tick, after which it surely waits for the next one (it begins by
running freely, and would drive vehicles that it gets meanwhile one step more), then all vehicles in
one batch.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import carla

from benchmarks.simulator.ticking import WatchedClock
from carstage.collector.internals.traffic_manager_wakeup import started_threads

_TIMEOUT_S = 60.0
_STRETCH_M = 9.0
_DROP_M = 0.5


@dataclass(frozen=True)
class Session:
    """What a trial works with."""

    client: carla.Client
    world: carla.World
    traffic_manager: carla.TrafficManager
    clock: WatchedClock
    random: random.Random


@contextmanager
def synchronous_session(
    port: int, *, delta_s: float, seed: int, traffic_manager_port: int | None = None
) -> Iterator[Session]:
    """Connects, switches to synchronous mode, and restores the settings on the way out.

    Args:
        port: the server's.
        delta_s: simulated seconds of a tick.
        seed: of the Traffic Manager, the walkers and the spawn choices.
        traffic_manager_port: a free one; None: one is looked for, which needs Car-STAGE's own
            interpreter.
    """
    client = carla.Client("127.0.0.1", port)
    client.set_timeout(_TIMEOUT_S)
    world = client.get_world()
    before = world.get_settings()
    settings = world.get_settings()
    settings.synchronous_mode = True
    settings.fixed_delta_seconds = delta_s
    with ExitStack() as restored:
        # Also when a later step fails: a server that waits for ticks is of no use to the next.
        restored.callback(lambda: world.apply_settings(before))
        world.apply_settings(settings)
        world = client.reload_world(False)
        if traffic_manager_port is None:
            from carstage.server import free_port

            traffic_manager_port = free_port()
        with started_threads() as threads:
            traffic_manager = client.get_trafficmanager(traffic_manager_port)
        restored.callback(traffic_manager.set_synchronous_mode, False)
        traffic_manager.set_synchronous_mode(True)
        traffic_manager.set_random_device_seed(seed)
        world.set_pedestrians_seed(seed)
        with WatchedClock(world, traffic_manager_port, threads) as clock:
            clock.tick()
            yield Session(client, world, traffic_manager, clock, random.Random(seed))


def spawn_traffic(
    session: Session, count: int, base_types: Sequence[str] = ("car",)
) -> list[carla.Vehicle]:
    """Spawns vehicles at shuffled spawn points and hands them to the Traffic Manager, in one batch.

    Where the map has fewer spawn points, the rest start on free stretches of its lanes.

    Raises:
        RuntimeError: no room for so many vehicles, or a spawn was refused.
    """
    library = session.world.get_blueprint_library().filter("vehicle.*")
    blueprints = sorted(
        (b for b in library if b.get_attribute("base_type").as_str() in base_types),
        key=lambda blueprint: str(blueprint.id),
    )
    points = session.world.get_map().get_spawn_points()
    session.random.shuffle(points)
    if len(points) < count:
        points += free_stretches(session.world.get_map(), points, count - len(points))
    if len(points) < count:
        raise RuntimeError(f"the map has room for {len(points)} vehicles, {count} are needed")
    port = session.traffic_manager.get_port()
    batch = []
    for point in points[:count]:
        blueprint = session.random.choice(blueprints)
        if blueprint.has_attribute("color"):
            colours = blueprint.get_attribute("color").recommended_values
            blueprint.set_attribute("color", session.random.choice(colours))
        blueprint.set_attribute("role_name", "autopilot")
        autopilot = carla.command.SetAutopilot(carla.command.FutureActor, True, port)
        batch.append(carla.command.SpawnActor(blueprint, point).then(autopilot))
    ids = []
    for response in session.client.apply_batch_sync(batch, False):
        if response.error:
            raise RuntimeError(f"a vehicle could not be spawned: {response.error}")
        ids.append(response.actor_id)
    session.clock.tick()
    return [session.world.get_actor(actor_id) for actor_id in ids]


def free_stretches(
    town: carla.Map, taken: Sequence[carla.Transform], count: int
) -> list[carla.Transform]:
    """Up to ``count`` places on lanes, outside junctions, with room to all others."""
    places = [point.location for point in taken]
    found: list[carla.Transform] = []
    for waypoint in town.generate_waypoints(_STRETCH_M):
        if len(found) == count:
            break
        pose = waypoint.transform
        crosses = waypoint.is_junction or any(w.is_junction for w in waypoint.next(_STRETCH_M))
        if crosses or min(map(pose.location.distance, places), default=_STRETCH_M) < _STRETCH_M:
            continue
        pose.location.z += _DROP_M
        places.append(pose.location)
        found.append(pose)
    return found


def spawn_walkers(session: Session, count: int) -> list[carla.Walker]:
    """Spawns walkers on the navigation mesh, each with an AI controller that is on its way.

    Raises:
        RuntimeError: the map has no navigation mesh, or too few walkers found a place.
    """
    world = session.world
    blueprints = sorted(
        world.get_blueprint_library().filter("walker.pedestrian.*"),
        key=lambda blueprint: str(blueprint.id),
    )
    controller_blueprint = world.get_blueprint_library().find("controller.ai.walker")
    walkers: list[carla.Walker] = []
    speeds = []
    for _ in range(count * 5):
        if len(walkers) == count:
            break
        location = world.get_random_location_from_navigation()
        if location is None:
            raise RuntimeError("the map has no navigation mesh")
        blueprint = session.random.choice(blueprints)
        blueprint.set_attribute("is_invincible", "false")
        location.z += 1.0
        walker = world.try_spawn_actor(blueprint, carla.Transform(location))
        if walker is not None:
            walkers.append(walker)
            speeds.append(float(blueprint.get_attribute("speed").recommended_values[1]))
    if len(walkers) < count:
        raise RuntimeError(f"only {len(walkers)} of {count} walkers found a free place")
    controllers = [
        world.spawn_actor(controller_blueprint, carla.Transform(), walker) for walker in walkers
    ]
    session.clock.tick()
    world.set_pedestrians_cross_factor(0.3)
    for controller, speed in zip(controllers, speeds, strict=True):
        controller.start()
        controller.go_to_location(world.get_random_location_from_navigation())
        controller.set_max_speed(speed)
    return walkers
