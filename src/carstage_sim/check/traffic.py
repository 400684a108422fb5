"""Does traffic flow? Fifty vehicles under the client's Traffic Manager for five minutes."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter

import carla
import numpy as np
from numpy.typing import NDArray

from carstage_sim.check.client_process import run_trial
from carstage_sim.check.server_process import running_server
from carstage_sim.check.session import spawn_traffic, spawn_walkers, synchronous_session
from carstage_sim.check.traffic_monitor import (
    TOUCHING_GAP_M,
    FloatArray,
    LightMonitor,
    TrafficMonitor,
)
from carstage_sim.check.verdict import Figure, Verdict

STUCK_AFTER_S = 90.0
LAST_MINUTE_S = 60.0
MOVED_M = 5.0
SAMPLE_EVERY_S = 0.5


@dataclass(slots=True)
class TrafficFigures:
    """What a trial measured.

    Attributes:
        longest_stand_s: longest time that a vehicle stood outside a queue for a light.
        touching: pairs of vehicles whose boxes came closer than :data:`TOUCHING_GAP_M`.
        narrowest_gap_m: between any two vehicles, at any time; at most 10.
        walkers_hit: walkers that were inside a moving vehicle's footprint.
        red_lights_run: times that a vehicle left a light's trigger volume, moving, under red.
        stuck: vehicles that stood longer than :data:`STUCK_AFTER_S` outside a queue.
    """

    vehicles: int
    simulated_s: float
    destroyed: int = 0
    mean_distance_m: float = 0.0
    mean_speed_kmh: float = 0.0
    moved_in_last_minute: float = 0.0
    longest_stand_s: float = 0.0
    stuck: int = 0
    touching: int = 0
    narrowest_gap_m: float = 10.0
    walkers_hit: int = 0
    lights_passed: int = 0
    red_lights_run: int = 0
    ticks_per_s: float = 0.0
    wake_ups: int = 0
    events: list[str] = field(default_factory=list)


def traffic_trial(
    port: int,
    *,
    vehicles: int,
    walkers: int,
    seconds: float,
    fps: int,
    seed: int,
    base_types: tuple[str, ...],
) -> TrafficFigures:
    """Drives the vehicles and measures; runs in the client's process."""
    with synchronous_session(port, delta_s=1.0 / fps, seed=seed) as session:
        actors = spawn_traffic(session, vehicles, base_types)
        pedestrians = spawn_walkers(session, walkers) if walkers else []
        boxes = [actor.bounding_box for actor in actors]
        monitor = TrafficMonitor(
            np.array([(b.location.x, b.location.y, b.location.z) for b in boxes]),
            np.array([(b.extent.x, b.extent.y, b.extent.z) for b in boxes]),
            [f"{actor.type_id}#{actor.id}" for actor in actors],
        )
        lights = LightMonitor()
        ticks = round(seconds * fps)
        every = max(round(SAMPLE_EVERY_S * fps), 1)
        speeds: list[FloatArray] = []
        distance_before_last_minute = np.zeros(vehicles)
        started = perf_counter()
        for tick in range(1, ticks + 1):
            session.clock.tick()
            for actor in actors:
                lights.sample(actor)
            if tick % every:
                continue
            location, yaw_deg, speed, held = _sample(session.world.get_snapshot(), actors)
            monitor.sample(every / fps, location, yaw_deg, speed, held)
            if pedestrians:
                places = [walker.get_location() for walker in pedestrians]
                middles = np.array([(place.x, place.y) for place in places])
                monitor.sample_walkers(middles, location, yaw_deg, speed)
            speeds.append(speed)
            if tick / fps <= seconds - LAST_MINUTE_S:
                distance_before_last_minute = monitor.distance_m.copy()
        moved = monitor.distance_m - distance_before_last_minute > MOVED_M
        return TrafficFigures(
            vehicles=vehicles,
            simulated_s=seconds,
            destroyed=int(np.isnan(speeds[-1]).sum()),
            mean_distance_m=float(monitor.distance_m.mean()),
            mean_speed_kmh=float(np.nanmean(speeds) * 3.6),
            moved_in_last_minute=float(moved.mean()),
            longest_stand_s=float(monitor.longest_stand_s.max()),
            stuck=int((monitor.longest_stand_s > STUCK_AFTER_S).sum()),
            touching=len(monitor.touching),
            narrowest_gap_m=monitor.narrowest_gap_m,
            walkers_hit=len(monitor.hit),
            lights_passed=lights.passed,
            red_lights_run=lights.red_run,
            ticks_per_s=ticks / (perf_counter() - started),
            wake_ups=session.clock.wake_ups,
            events=_events(monitor, actors, location, speed),
        )


def _sample(
    snapshot: carla.WorldSnapshot, actors: list[carla.Vehicle]
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    rows = np.full((len(actors), 5), np.nan)
    held = np.zeros(len(actors), dtype=np.bool_)
    for index, actor in enumerate(actors):
        state = snapshot.find(actor.id)
        if state is None:
            continue
        transform, velocity = state.get_transform(), state.get_velocity()
        place = transform.location
        rows[index] = (place.x, place.y, place.z, transform.rotation.yaw, velocity.length())
        held[index] = (
            actor.is_at_traffic_light()
            and actor.get_traffic_light_state() != carla.TrafficLightState.Green
        )
    return rows[:, :3], rows[:, 3], rows[:, 4], held


def _events(
    monitor: TrafficMonitor, actors: list[carla.Vehicle], location: FloatArray, speed: FloatArray
) -> list[str]:
    """Where it went wrong, for whoever has to mend it."""
    names = [f"{actor.type_id}#{actor.id}" for actor in actors]
    events = [
        f"{names[i]} and {names[j]} came to {gap:.2f} m"
        for (i, j), gap in sorted(monitor.touching.items())
    ]
    for index in np.flatnonzero(monitor.longest_stand_s > 30.0):
        x, y, z = location[index]
        events.append(
            f"{names[index]} stood {monitor.longest_stand_s[index]:.0f} s outside a queue; at the "
            f"end at ({x:.1f}, {y:.1f}, {z:.1f}) with {speed[index]:.1f} m/s"
        )
    return events


def check_traffic(
    *,
    vehicles: int = 50,
    walkers: int = 0,
    seconds: float = 300.0,
    fps: int = 20,
    seed: int = 7,
    base_types: tuple[str, ...] = ("car",),
    server_arguments: tuple[str, ...] = (),
) -> Verdict:
    """Starts a server, lets traffic flow, and judges it."""
    with running_server(server_arguments) as port:
        figures = run_trial(
            traffic_trial,
            port,
            vehicles=vehicles,
            walkers=walkers,
            seconds=seconds,
            fps=fps,
            seed=seed,
            base_types=base_types,
            timeout_s=120.0 + 4.0 * seconds,
        )
    return judge(figures)


def judge(figures: TrafficFigures) -> Verdict:
    """The figures of a trial beside their targets."""
    return Verdict(
        "traffic",
        (
            Figure("vehicles", figures.vehicles),
            Figure("simulated_s", figures.simulated_s),
            Figure("destroyed", figures.destroyed, "==", 0),
            Figure("stuck_over_90_s_outside_a_queue", figures.stuck, "==", 0),
            Figure("longest_stand_outside_a_queue_s", figures.longest_stand_s, "<=", STUCK_AFTER_S),
            Figure("touching_pairs", figures.touching, "==", 0),
            Figure("narrowest_gap_m", figures.narrowest_gap_m, ">=", TOUCHING_GAP_M),
            Figure("walkers_hit", figures.walkers_hit, "==", 0),
            Figure("lights_passed", figures.lights_passed),
            Figure("red_lights_run", figures.red_lights_run, "==", 0),
            Figure("mean_speed_kmh", figures.mean_speed_kmh, ">=", 9.0),
            Figure("mean_distance_m", figures.mean_distance_m, ">=", figures.simulated_s * 2.5),
            Figure("share_moved_in_last_minute", figures.moved_in_last_minute, ">=", 0.95),
            Figure("ticks_per_s", figures.ticks_per_s),
            Figure("lost_wake_ups_of_the_client", figures.wake_ups),
        ),
        figures.events,
    )
