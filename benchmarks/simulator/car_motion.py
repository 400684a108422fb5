"""Does a car move like one? In traffic under the Traffic Manager, and on a straight road.

The acceleration is what the snapshot says, along and across the car; the jerk its change from frame
to frame. Cars of the whole traffic are pooled: each of them could be the ego.
"""

from __future__ import annotations

from dataclasses import dataclass

import carla
import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.server_process import started_server
from benchmarks.simulator.session import spawn_traffic, synchronous_session
from benchmarks.simulator.straight_line import straight_line_trial
from carstage.bench.verdict import Figure, Verdict

_SETTLED_S = 2.0
_WATCHED = 10
_PERCENTILE = 99
_MOST_ACCELERATION = 3.5
_MOST_JERK = 6.0
_RATES_HZ = (10, 20)
_HARD_M_S2 = 3.5
_LEAST_EMERGENCY_M_S2 = 7.0
_FARTHEST_OFF_PERCENT = 15.0
_STRAIGHT_TOWN = "Stage03"
_LONG_BAKE_S = 900.0

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CarMotion:
    """What cars felt.

    Attributes:
        acceleration: ``(ticks, cars, 2)`` m/s², along and across.
        fps: ticks in a second.
    """

    acceleration: FloatArray
    fps: int

    def strong(self, axis: int) -> float:
        """The 99th percentile of the acceleration's size along an axis, m/s²."""
        return float(np.percentile(np.abs(self.acceleration[..., axis]), _PERCENTILE))

    @property
    def braking_hard(self) -> float:
        """Share of the time with more than 3.5 m/s² of deceleration, percent."""
        return float(100.0 * np.mean(self.acceleration[..., 0] < -_HARD_M_S2))

    def jerk(self, axis: int) -> float:
        """Root mean square of the jerk along an axis, m/s³."""
        jerk = np.diff(self.acceleration[..., axis], axis=0) * self.fps
        return float(np.sqrt(np.mean(jerk**2)))


def motion_trial(port: int, *, fps: int, seconds: float, vehicles: int, seed: int) -> CarMotion:
    """Drives for a while; runs in the client's process."""
    with synchronous_session(port, delta_s=1.0 / fps, seed=seed) as session:
        cars = spawn_traffic(session, vehicles)[:_WATCHED]
        for _ in range(round(_SETTLED_S * fps)):
            session.clock.tick()
        felt = np.empty((round(seconds * fps), len(cars), 2))
        for row in felt:
            session.clock.tick()
            snapshot = session.world.get_snapshot()
            for car, along_and_across in zip(cars, row, strict=True):
                along_and_across[:] = _felt(snapshot.find(car.id))
    return CarMotion(felt, fps)


def _felt(state: carla.ActorSnapshot) -> tuple[float, float]:
    pose, acceleration = state.get_transform(), state.get_acceleration()
    return (
        float(acceleration.dot(pose.get_forward_vector())),
        float(acceleration.dot(pose.get_right_vector())),
    )


def check_car_motion(*, minutes: float, town: str, vehicles: int, seed: int) -> Verdict:
    """Are accelerations and jerks those of a driven car, and pedals worth what they should be?

    Args:
        minutes: simulated, for each frame rate.
        town: where.
        vehicles: how much traffic there is.
        seed: of everything that is drawn.
    """
    figures = [Figure("seed", seed), Figure("minutes", minutes)]
    for fps in _RATES_HZ:
        with started_server(("--map", town)) as server:
            motion = run_trial(
                motion_trial,
                server.port,
                fps=fps,
                seconds=60.0 * minutes,
                vehicles=vehicles,
                seed=seed,
                timeout_s=3600.0,
            )
        figures.append(Figure(f"braking_hard_at_{fps}_hz_percent", motion.braking_hard))
        for axis, name in enumerate(("along", "across")):
            strong, jerk = motion.strong(axis), motion.jerk(axis)
            figures += [
                Figure(f"acceleration_{name}_at_{fps}_hz_m_s2", strong, "<=", _MOST_ACCELERATION),
                Figure(f"jerk_{name}_at_{fps}_hz_m_s3", jerk, "<=", _MOST_JERK),
            ]
    figures += _straight_line_figures(seed)
    return Verdict("car-motion", tuple(figures))


def _straight_line_figures(seed: int) -> list[Figure]:
    """Differences to what physics controls say, by blueprint, and the weakest emergency brake."""
    arguments = ("--map", _STRAIGHT_TOWN)
    with started_server(arguments, start_timeout_s=_LONG_BAKE_S) as server:
        cars = run_trial(straight_line_trial, server.port, seed=seed, timeout_s=1200.0)
    figures = []
    for type_id, (measured, expected) in cars.items():
        name = type_id.removeprefix("vehicle.").replace(".", "_")
        for what, value, wanted in (
            ("to_100_km_h_s", measured.to_100_km_h_s, expected.to_100_km_h_s),
            ("braking_m", measured.braking_m, expected.braking_m),
        ):
            off = 100.0 * abs(value / wanted - 1.0)
            figures += [
                Figure(f"{name}_{what}", value),
                Figure(f"{name}_{what}_off_percent", off, "<=", _FARTHEST_OFF_PERCENT),
            ]
    weakest = min(measured.hardest_m_s2 for measured, _ in cars.values())
    return [*figures, Figure("emergency_braking_m_s2", weakest, ">=", _LEAST_EMERGENCY_M_S2)]
