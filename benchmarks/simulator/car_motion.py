"""Does a car in traffic move like one? Its accelerations and jerks, driven with comfort.

That is by the Traffic Manager, whom the collector tells how fast to go. The Traffic Manager alone
is measured beside it. The acceleration is what the snapshot says, along and across the car; the
jerk its change from frame to frame. Some cars of the traffic are pooled: each could be the ego.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import carla
import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.server_process import started_server
from benchmarks.simulator.session import Session, spawn_traffic, synchronous_session
from carstage.bench.verdict import Figure, Verdict
from carstage.collector.comfort import ComfortableDriving, RoadUsers, StopLines, Streets
from carstage.spec import ComfortSpec

_SETTLED_S = 2.0
_WATCHED = 10
_PERCENTILE = 99
_MOST_ACCELERATION = 3.5
_MOST_JERK = 6.0
_RATES_HZ = (10, 20)

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

    def jerk(self, axis: int) -> float:
        """Root mean square of the jerk along an axis, m/s³."""
        jerk = np.diff(self.acceleration[..., axis], axis=0) * self.fps
        return float(np.sqrt(np.mean(jerk**2)))


def motion_trial(
    port: int, *, fps: int, seconds: float, vehicles: int, seed: int, comfort: bool
) -> CarMotion:
    """Drives for a while; runs in the client's process."""
    with synchronous_session(port, delta_s=1.0 / fps, seed=seed) as session:
        cars = spawn_traffic(session, vehicles)[:_WATCHED]
        drives = _comfortable(session, cars, 1.0 / fps) if comfort else []
        settling = round(_SETTLED_S * fps)
        felt = np.empty((round(seconds * fps), len(cars), 2))
        for number in range(settling + len(felt)):
            for driving in drives:
                driving.before_step()
            session.clock.tick()
            row = felt[max(number - settling, 0)]
            snapshot = session.world.get_snapshot()
            for car, along_and_across in zip(cars, row, strict=True):
                along_and_across[:] = _felt(snapshot.find(car.id))
    return CarMotion(felt, fps)


def _comfortable(
    session: Session, cars: Sequence[carla.Vehicle], step_s: float
) -> list[ComfortableDriving]:
    """The cars' driving, as the collector has it with comfort."""
    world = session.world
    streets = Streets(
        session.traffic_manager,
        world,
        world.get_map(),
        StopLines(world.get_actors().filter("traffic.traffic_light")),
        RoadUsers(world),
        step_s,
    )
    return [ComfortableDriving(streets, car, ComfortSpec()) for car in cars]


def _felt(state: carla.ActorSnapshot) -> tuple[float, float]:
    pose, acceleration = state.get_transform(), state.get_acceleration()
    return (
        float(acceleration.dot(pose.get_forward_vector())),
        float(acceleration.dot(pose.get_right_vector())),
    )


def check_car_motion(*, minutes: float, town: str, vehicles: int, seed: int) -> Verdict:
    """Are accelerations and jerks those of a driven car?

    Args:
        minutes: simulated, for each frame rate.
        town: where.
        vehicles: how much traffic there is.
        seed: of everything that is drawn.
    """
    figures = [Figure("seed", seed), Figure("minutes", minutes)]
    for fps in _RATES_HZ:
        for comfort in (True, False):
            with started_server(("--map", town)) as server:
                motion = run_trial(
                    motion_trial,
                    server.port,
                    fps=fps,
                    seconds=60.0 * minutes,
                    vehicles=vehicles,
                    seed=seed,
                    comfort=comfort,
                    timeout_s=3600.0,
                )
            figures += _figures(motion, fps, comfort)
    return Verdict("car-motion", tuple(figures))


def _figures(motion: CarMotion, fps: int, comfort: bool) -> list[Figure]:
    """Along and across; without targets for the Traffic Manager alone."""
    figures = []
    who = "" if comfort else "traffic_manager_alone_"
    for axis, name in enumerate(("along", "across")):
        strong, jerk = motion.strong(axis), motion.jerk(axis)
        strong_name = f"{who}acceleration_{name}_at_{fps}_hz_m_s2"
        jerk_name = f"{who}jerk_{name}_at_{fps}_hz_m_s3"
        if comfort:
            figures.append(Figure(strong_name, strong, "<=", _MOST_ACCELERATION))
            figures.append(Figure(jerk_name, jerk, "<=", _MOST_JERK))
        else:
            figures += [Figure(strong_name, strong), Figure(jerk_name, jerk)]
    return figures
