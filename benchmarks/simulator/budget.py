"""What does a tick without sensors cost the server, the commands of its clients included?

A hundred vehicles are driven by the client's own Traffic Manager and walkers by its AI controllers;
five hundred, which the Traffic Manager is too slow for, follow their lanes by a few lines of this
check. Either way every tick brings the server a batch of controls to decode, to step and to report
in a snapshot. The time is the CPU time of the server's process alone, all its threads together.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import carla

from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.server_process import started_server
from benchmarks.simulator.session import spawn_walkers, synchronous_session
from carstage.bench.calibration import slowness
from carstage.bench.process_figures import process_cpu_s
from carstage.bench.verdict import Figure, Verdict

FLEETS: tuple[tuple[int, int, float], ...] = ((100, 50, 6.0), (500, 0, 20.0))
"""Vehicles, walkers, and milliseconds that a tick may take on the reference machine."""

_DELTA_S = 0.05
_WARM_UP_TICKS = 40
_SPACING_M = 6.5
_HEIGHT_M = 0.5
_MOST_ON_AUTOPILOT = 200
_LOOK_AHEAD_M = 4.0
_SPEED_M_S = 5.0


def places(world: carla.World) -> list[carla.Transform]:
    """Where vehicles may stand: spawn points first, then places all along the lanes."""
    town = world.get_map()
    found = list(town.get_spawn_points())
    for waypoint in town.generate_waypoints(_SPACING_M):
        if not waypoint.is_junction:
            place = waypoint.transform
            place.location.z += _HEIGHT_M
            found.append(place)
    return found


def _spawn_vehicles(
    client: carla.Client, world: carla.World, count: int, *, driver_port: int = 0, seed: int
) -> list[int]:
    chance, library = random.Random(seed), world.get_blueprint_library().filter("vehicle.*")
    cars = sorted(
        (b for b in library if b.get_attribute("base_type").as_str() == "car"),
        key=lambda blueprint: str(blueprint.id),
    )
    free = places(world)
    spawned: list[int] = []
    while len(spawned) < count and free:
        wanted = count - len(spawned)
        batch = [carla.command.SpawnActor(chance.choice(cars), place) for place in free[:wanted]]
        if driver_port:
            driver = carla.command.SetAutopilot(carla.command.FutureActor, True, driver_port)
            batch = [command.then(driver) for command in batch]
        del free[:wanted]
        # Places where somebody stands already are refused.
        answers = client.apply_batch_sync(batch, False)
        spawned += [answer.actor_id for answer in answers if not answer.error]
    if len(spawned) < count:
        raise RuntimeError(f"the map has room for {len(spawned)} vehicles, {count} are needed")
    return spawned


def _follow_lanes(
    client: carla.Client, world: carla.World, town: carla.Map, ids: list[int]
) -> None:
    """Sends all vehicles controls that keep them slowly on their lanes."""
    snapshot = world.get_snapshot()
    batch = []
    for actor_id in ids:
        state = snapshot.find(actor_id)
        place, velocity = state.get_transform(), state.get_velocity()
        ahead = town.get_waypoint(place.location).next(_LOOK_AHEAD_M)
        target = ahead[0].transform.location if ahead else place.location
        bearing = math.degrees(math.atan2(target.y - place.location.y, target.x - place.location.x))
        off = math.remainder(bearing - place.rotation.yaw, 360.0)
        too_fast = math.hypot(velocity.x, velocity.y) > _SPEED_M_S
        control = carla.VehicleControl(
            throttle=0.0 if too_fast else 0.4, steer=max(-0.7, min(0.7, off / 70.0))
        )
        batch.append(carla.command.ApplyVehicleControl(actor_id, control))
    client.apply_batch(batch)


def budget_trial(
    port: int, server_pid: int, *, vehicles: int, walkers: int, ticks: int, seed: int
) -> float:
    """CPU milliseconds of the server per tick; runs in the client's process."""
    if vehicles > _MOST_ON_AUTOPILOT:
        return _without_traffic_manager(port, server_pid, vehicles, ticks, seed)
    with synchronous_session(port, delta_s=_DELTA_S, seed=seed) as session:
        driver_port = session.traffic_manager.get_port()
        _spawn_vehicles(session.client, session.world, vehicles, driver_port=driver_port, seed=seed)
        session.clock.tick()
        if walkers:
            spawn_walkers(session, walkers)
        return _cpu_ms_per_tick(server_pid, ticks, session.clock.tick)


def _without_traffic_manager(
    port: int, server_pid: int, vehicles: int, ticks: int, seed: int
) -> float:
    client = carla.Client("127.0.0.1", port)
    client.set_timeout(60.0)
    world = client.get_world()
    settings = world.get_settings()
    settings.synchronous_mode = True
    settings.fixed_delta_seconds = _DELTA_S
    world.apply_settings(settings)
    ids = _spawn_vehicles(client, world, vehicles, seed=seed)
    town = world.get_map()
    world.tick()

    def drive_on() -> None:
        _follow_lanes(client, world, town, ids)
        world.tick()

    return _cpu_ms_per_tick(server_pid, ticks, drive_on)


def _cpu_ms_per_tick(server_pid: int, ticks: int, tick: Callable[[], object]) -> float:
    for _ in range(_WARM_UP_TICKS):
        tick()
    before = process_cpu_s(server_pid)
    for _ in range(ticks):
        tick()
    return (process_cpu_s(server_pid) - before) / ticks * 1e3


def check_budget(*, ticks: int = 200, seed: int = 7, town: str = "Stage01") -> Verdict:
    """Measures each fleet on a fresh server.

    The figures are scaled by how slow the machine is at the moment, measured before and after.
    """
    figures = [Figure("map", town), Figure("ticks", ticks)]
    for vehicles, walkers, target_ms in FLEETS:
        with started_server(("--map", town, "--threads", "1")) as server:
            slow = slowness()
            raw_ms = run_trial(
                budget_trial,
                server.port,
                server.pid,
                vehicles=vehicles,
                walkers=walkers,
                ticks=ticks,
                seed=seed,
                timeout_s=300.0 + ticks * 2.0,
            )
            slow = max(1.0, 0.5 * (slow + slowness()))
        name = f"{vehicles}_vehicles_{walkers}_walkers"
        figures += [
            Figure(f"machine_slowness_at_{name}", slow),
            Figure(f"cpu_ms_per_tick_of_{name}", raw_ms),
            Figure(f"scaled_cpu_ms_per_tick_of_{name}", raw_ms / slow, "<=", target_ms),
        ]
    return Verdict("budget", tuple(figures))
