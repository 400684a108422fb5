"""Does traffic flow? Fifty vehicles under the client's Traffic Manager for five minutes."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter

import carla
import numpy as np
from numpy.typing import NDArray

from carstage_sim.check.client_process import run_trial
from carstage_sim.check.server_process import running_server
from carstage_sim.check.session import spawn_traffic, synchronous_session
from carstage_sim.check.verdict import Figure, Verdict
from carstage_sim.world.overlap import footprint_corners

STANDING_SPEED = 0.1  # m/s
QUEUE_GAP_M = 12.0
STUCK_AFTER_S = 90.0
TOUCHING_GAP_M = 0.05
"""The server pushes overlapping vehicles apart, so a collision shows as a gap of nothing."""
LAST_MINUTE_S = 60.0
MOVED_M = 5.0
SAMPLE_EVERY_S = 0.5

FloatArray = NDArray[np.float64]


@dataclass(slots=True)
class TrafficFigures:
    """What a trial measured.

    Attributes:
        longest_stand_s: longest time that a vehicle stood outside a queue for a light.
        touching: pairs of vehicles whose boxes came closer than :data:`TOUCHING_GAP_M`.
        narrowest_gap_m: between any two vehicles, at any time; at most 10.
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
    ticks_per_s: float = 0.0
    wake_ups: int = 0
    events: list[str] = field(default_factory=list)


def gap_m(
    center_a: FloatArray,
    extent_a: FloatArray,
    yaw_a_deg: float,
    center_b: FloatArray,
    extent_b: FloatArray,
    yaw_b_deg: float,
) -> float:
    """Widest gap between two footprints along any of their axes; negative when they overlap.

    Of separate boxes it is at most their distance, of overlapping ones minus the least way out.

    Args:
        center_a, extent_a: ``(2 or 3,)`` centre and half sizes, metres.
        yaw_a_deg: heading of the box.
    """
    one = footprint_corners(center_a, extent_a, np.asarray(yaw_a_deg))
    other = footprint_corners(center_b, extent_b, np.asarray(yaw_b_deg))
    widest = -np.inf
    for yaw_deg in (yaw_a_deg, yaw_a_deg + 90.0, yaw_b_deg, yaw_b_deg + 90.0):
        axis = np.array([np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))])
        a, b = one @ axis, other @ axis
        widest = max(widest, b.min() - a.max(), a.min() - b.max())
    return float(widest)


class TrafficMonitor:
    """Watches samples of all vehicles and keeps the figures.

    Args:
        box_center, box_extent: ``(N, 3)`` bounding boxes in the vehicles' frames.
        names: what to call each vehicle in events.
    """

    def __init__(self, box_center: FloatArray, box_extent: FloatArray, names: list[str]) -> None:
        self._center, self._extent, self._names = box_center, box_extent, names
        self.standing_s = np.zeros(len(names))
        self.longest_stand_s = np.zeros(len(names))
        self.distance_m = np.zeros(len(names))
        self.touching: dict[tuple[int, int], float] = {}
        self.narrowest_gap_m = 10.0
        self._last_location: FloatArray | None = None

    def sample(
        self,
        elapsed_s: float,
        location: FloatArray,
        yaw_deg: FloatArray,
        speed: FloatArray,
        held_by_light: NDArray[np.bool_],
    ) -> None:
        """Takes one sample; a row of NaN is a vehicle that is gone.

        Args:
            elapsed_s: time since the last sample.
            location: ``(N, 3)``; yaw_deg, speed: ``(N,)``.
            held_by_light: ``(N,)`` whether a light that is not green holds the vehicle.
        """
        if self._last_location is not None:
            self.distance_m += np.nan_to_num(np.linalg.norm(location - self._last_location, axis=1))
        self._last_location = location
        standing = speed < STANDING_SPEED
        queued = self._queued(location, yaw_deg, standing, held_by_light)
        self.standing_s = np.where(
            standing & ~queued, self.standing_s + elapsed_s, np.where(standing, self.standing_s, 0)
        )
        self.longest_stand_s = np.maximum(self.longest_stand_s, self.standing_s)
        self._find_gaps(location, yaw_deg)

    def _queued(
        self,
        location: FloatArray,
        yaw_deg: FloatArray,
        standing: NDArray[np.bool_],
        held: NDArray[np.bool_],
    ) -> NDArray[np.bool_]:
        """Who stands at a light, or behind one who does."""
        yaw = np.radians(yaw_deg)
        forward = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
        offset = location[None, :, :2] - location[:, None, :2]
        ahead = np.einsum("ijk,ik->ij", offset, forward)
        aside = np.abs(offset[..., 1] * forward[:, None, 0] - offset[..., 0] * forward[:, None, 1])
        gap = ahead - self._extent[:, None, 0] - self._extent[None, :, 0]
        follows = (ahead > 0.0) & (gap < QUEUE_GAP_M) & (aside < 2.5)
        queued: NDArray[np.bool_] = standing & held
        for _ in range(len(self._names)):
            grown = queued | (standing & (follows & queued[None, :]).any(axis=1))
            if (grown == queued).all():
                break
            queued = grown
        return queued

    def _find_gaps(self, location: FloatArray, yaw_deg: FloatArray) -> None:
        yaw = np.radians(yaw_deg)
        forward = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=-1)
        center = location + self._center[:, 0:1] * forward
        reach = np.linalg.norm(self._extent[:, :2], axis=1)
        distance = np.linalg.norm(center[:, None, :2] - center[None, :, :2], axis=-1)
        near = np.triu(distance < reach[:, None] + reach[None, :], k=1)
        for i, j in np.argwhere(near):
            gap = gap_m(
                center[i], self._extent[i], yaw_deg[i], center[j], self._extent[j], yaw_deg[j]
            )
            self.narrowest_gap_m = min(self.narrowest_gap_m, gap)
            if gap < TOUCHING_GAP_M:
                pair = (int(i), int(j))
                self.touching[pair] = min(self.touching.get(pair, gap), gap)


def traffic_trial(
    port: int, *, vehicles: int, seconds: float, fps: int, seed: int, base_types: tuple[str, ...]
) -> TrafficFigures:
    """Drives the vehicles and measures; runs in the client's process."""
    with synchronous_session(port, delta_s=1.0 / fps, seed=seed) as session:
        actors = spawn_traffic(session, vehicles, base_types)
        boxes = [actor.bounding_box for actor in actors]
        monitor = TrafficMonitor(
            np.array([(b.location.x, b.location.y, b.location.z) for b in boxes]),
            np.array([(b.extent.x, b.extent.y, b.extent.z) for b in boxes]),
            [f"{actor.type_id}#{actor.id}" for actor in actors],
        )
        figures = TrafficFigures(vehicles, seconds)
        ticks = round(seconds * fps)
        every = max(round(SAMPLE_EVERY_S * fps), 1)
        speeds: list[FloatArray] = []
        distance_before_last_minute = np.zeros(vehicles)
        started = perf_counter()
        for tick in range(1, ticks + 1):
            session.clock.tick()
            if tick % every:
                continue
            location, yaw_deg, speed, held = _sample(session.world.get_snapshot(), actors)
            monitor.sample(every / fps, location, yaw_deg, speed, held)
            speeds.append(speed)
            if tick / fps <= seconds - LAST_MINUTE_S:
                distance_before_last_minute = monitor.distance_m.copy()
        figures.ticks_per_s = ticks / (perf_counter() - started)
        figures.wake_ups = session.clock.wake_ups
        figures.destroyed = int(np.isnan(speeds[-1]).sum())
        figures.mean_distance_m = float(monitor.distance_m.mean())
        figures.mean_speed_kmh = float(np.nanmean(speeds) * 3.6)
        moved = monitor.distance_m - distance_before_last_minute > MOVED_M
        figures.moved_in_last_minute = float(moved.mean())
        figures.longest_stand_s = float(monitor.longest_stand_s.max())
        figures.stuck = int((monitor.longest_stand_s > STUCK_AFTER_S).sum())
        figures.touching = len(monitor.touching)
        figures.narrowest_gap_m = monitor.narrowest_gap_m
        figures.events = _events(monitor, actors, location, speed)
        return figures


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
            Figure("mean_speed_kmh", figures.mean_speed_kmh, ">=", 9.0),
            Figure("mean_distance_m", figures.mean_distance_m, ">=", figures.simulated_s * 2.5),
            Figure("share_moved_in_last_minute", figures.moved_in_last_minute, ">=", 0.95),
            Figure("ticks_per_s", figures.ticks_per_s),
            Figure("lost_wake_ups_of_the_client", figures.wake_ups),
        ),
        figures.events,
    )
