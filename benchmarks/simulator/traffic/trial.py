"""The drive itself; runs in the client's process."""

from __future__ import annotations

import sys
from time import monotonic

import numpy as np

from benchmarks.simulator.session import spawn_traffic, spawn_walkers, synchronous_session
from benchmarks.simulator.traffic.recorder import Recorder
from benchmarks.simulator.traffic.recording import Recording

_REPORT_EVERY_S = 15.0
_SETTING_OFF_S = 10.0


def traffic_trial(
    port: int,
    *,
    vehicles: int,
    walkers: int,
    seconds: float,
    fps: int,
    seed: int,
    base_types: tuple[str, ...],
) -> Recording:
    """Lets the client's Traffic Manager drive, and records."""
    ticks = round(seconds * fps)
    with synchronous_session(port, delta_s=1.0 / fps, seed=seed) as session:
        drivers = spawn_traffic(session, vehicles, base_types)
        pedestrians = spawn_walkers(session, walkers) if walkers else []
        with Recorder(
            session.world, drivers, pedestrians, ticks=ticks, delta_s=1.0 / fps
        ) as recorder:
            progress = _Progress(seconds)
            for tick in range(1, ticks + 1):
                session.clock.tick()
                recorder.sample()
                progress.report(tick / fps)
        return recorder.recording(
            ticks_per_s=ticks / progress.elapsed_s, wake_ups=session.clock.wake_ups
        )


def lone_vehicles_trial(
    port: int, *, vehicles: int, seconds: float, fps: int, seed: int, base_types: tuple[str, ...]
) -> tuple[float, float]:
    """Mean speeds (m/s) of vehicles that neither see nor can touch each other.

    They are the same Traffic Manager's, with its own way of slowing down in turns and before
    lights of any colour. The first seconds, in which they set off, do not count.

    Args:
        port: the server's.
        vehicles: how many of each sort.
        seconds, fps, seed, base_types: of the drive.

    Returns:
        The speed of those that ignore lights and signs, which is free flow, and of those that stop
        at red: what the lights alone leave of it.
    """
    speeds = []
    with synchronous_session(port, delta_s=1.0 / fps, seed=seed) as session:
        drivers = spawn_traffic(session, 2 * vehicles, base_types)
        manager = session.traffic_manager
        for number, driver in enumerate(drivers):
            driver.set_collisions(False)
            manager.ignore_vehicles_percentage(driver, 100.0)
            if number < vehicles:
                manager.ignore_lights_percentage(driver, 100.0)
                manager.ignore_signs_percentage(driver, 100.0)
        for tick in range(round((_SETTING_OFF_S + seconds) * fps)):
            session.clock.tick()
            if tick >= _SETTING_OFF_S * fps:
                snapshot = session.world.get_snapshot()
                states = [snapshot.find(driver.id) for driver in drivers]
                speeds.append(
                    [np.nan if state is None else state.get_velocity().length() for state in states]
                )
    mean = np.nanmean(speeds, axis=0)
    return float(mean[:vehicles].mean()), float(mean[vehicles:].mean())


class _Progress:
    """Tells people on stderr how far a drive is."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._started = self._reported = monotonic()

    @property
    def elapsed_s(self) -> float:
        """Seconds of wall time since the start."""
        return monotonic() - self._started

    def report(self, simulated_s: float) -> None:
        """Prints a line when the last one is some seconds old."""
        now = monotonic()
        if now - self._reported < _REPORT_EVERY_S:
            return
        self._reported = now
        left_s = self.elapsed_s * (self._seconds / simulated_s - 1.0)
        print(
            f"  {simulated_s:.0f} of {self._seconds:.0f} s simulated, {left_s:.0f} s to go",
            file=sys.stderr,
            flush=True,
        )
