"""What does a tick without sensors cost the server, the commands of its clients included?

The client's own Traffic Manager drives the vehicles and its AI controllers the walkers, so that
every tick brings the server a batch of controls to decode, to step and to report in a snapshot. The
time is the CPU time of the server's process alone, all its threads together.
"""

from __future__ import annotations

import argparse

import carla

from carstage_sim.check.calibration import slowness
from carstage_sim.check.client_process import run_trial
from carstage_sim.check.process_figures import cpu_s
from carstage_sim.check.server_process import started_server
from carstage_sim.check.session import Session, spawn_walkers, synchronous_session
from carstage_sim.check.verdict import Figure, Verdict

FLEETS: tuple[tuple[int, int, float], ...] = ((100, 50, 6.0), (500, 0, 20.0))
"""Vehicles, walkers, and milliseconds that a tick may take on the reference machine."""

_DELTA_S = 0.05
_WARM_UP_TICKS = 40
_SPACING_M = 6.5
_HEIGHT_M = 0.5


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


def _spawn_vehicles(session: Session, count: int) -> None:
    library = session.world.get_blueprint_library().filter("vehicle.*")
    cars = sorted(
        (b for b in library if b.get_attribute("base_type").as_str() == "car"),
        key=lambda blueprint: str(blueprint.id),
    )
    port = session.traffic_manager.get_port()
    free = places(session.world)
    spawned = 0
    while spawned < count and free:
        batch = [
            carla.command.SpawnActor(session.random.choice(cars), place).then(
                carla.command.SetAutopilot(carla.command.FutureActor, True, port)
            )
            for place in free[: count - spawned]
        ]
        del free[: count - spawned]
        # Places where somebody stands already are refused.
        spawned += sum(not r.error for r in session.client.apply_batch_sync(batch, False))
    if spawned < count:
        raise RuntimeError(f"the map has room for {spawned} vehicles, {count} are needed")
    session.clock.tick()


def budget_trial(
    port: int, server_pid: int, *, vehicles: int, walkers: int, ticks: int, seed: int
) -> float:
    """CPU milliseconds of the server per tick; runs in the client's process."""
    with synchronous_session(port, delta_s=_DELTA_S, seed=seed) as session:
        _spawn_vehicles(session, vehicles)
        if walkers:
            spawn_walkers(session, walkers)
        for _ in range(_WARM_UP_TICKS):
            session.clock.tick()
        before = cpu_s(server_pid)
        for _ in range(ticks):
            session.clock.tick()
        return (cpu_s(server_pid) - before) / ticks * 1e3


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


def add_budget(checks: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the check to a command line."""
    parser = checks.add_parser("budget", help="a tick without sensors costs the server little")
    parser.add_argument("--ticks", type=int, default=200, help="of each measurement")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--map", default="Stage01", help="map that the server starts with")
    parser.add_argument("--json", action="store_true", help="last line is a JSON object")
