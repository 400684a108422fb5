"""An ego of the Traffic Manager drives gently, at the limit, through lights, the same each time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from carstage.rawlog.reader import EpisodeLog
from running_collector import Collector

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("collector")]

PlanMaker = Callable[..., dict[str, Any]]
FPS = 10
START_BEFORE_RED = 7
COMFORT = {
    "acceleration_m_s2": 1.8,
    "lateral_m_s2": 1.8,
    "jerk_m_s3": 2.5,
    "gap_s": 1.6,
}
GNSS = {
    "id": "GNSS",
    "kind": "gnss",
    "blueprint": "sensor.other.gnss",
    "attributes": {},
    "pose": {"x_m": 0.0, "y_m": 0.0, "z_m": 0.0, "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0},
}


class Ride:
    """What the ego of a log did: ``speed`` m/s, ``felt`` (ticks, 2) m/s² along and across."""

    def __init__(self, log: EpisodeLog) -> None:
        ego = log.header["ego_id"]
        parts = log.sealed_segments("world")
        frames = [frame for part in parts for frame in log.world_frames(part)]
        rows = [frame.row(ego) for frame in frames]
        self.places = np.array([f.location[r] for f, r in zip(frames, rows, strict=True)])
        velocity = np.array([f.velocity[r, :2] for f, r in zip(frames, rows, strict=True)])
        self.speed = np.hypot(*velocity.T)
        yaw = np.radians([f.rotation_deg[r, 1] for f, r in zip(frames, rows, strict=True)])
        x, y = np.array([f.acceleration[r, :2] for f, r in zip(frames, rows, strict=True)]).T
        along, across = x * np.cos(yaw) + y * np.sin(yaw), y * np.cos(yaw) - x * np.sin(yaw)
        self.felt = np.stack((along, across), axis=1)
        self.limit = np.array([f.meta["ego"]["speed_limit_kmh"] for f in frames]) / 3.6
        self.light = [f.meta["ego"]["traffic_light_state"] for f in frames]

    @property
    def strong(self) -> np.ndarray:
        """The 99th percentiles of its accelerations' sizes, along and across."""
        return np.percentile(np.abs(self.felt), 99, axis=0)

    @property
    def jerk(self) -> np.ndarray:
        """Root mean square of its jerks, along and across, m/s³."""
        return np.sqrt(np.mean((np.diff(self.felt, axis=0) * FPS) ** 2, axis=0))


@pytest.fixture
def ride(collector: Collector, make_plan: PlanMaker, tmp_path: Path) -> Callable[..., Ride]:
    def drive(name: str, *, gently: bool = True, **spec: Any) -> Ride:
        plan = make_plan(tmp_path / name, sensors=[GNSS], fps=float(FPS), **spec)
        if gently:
            planned = plan["episodes"][0]["spec"]
            planned["ego"] = {**planned["ego"], "comfort": COMFORT}
        plan["episodes"][0]["spec"]["vehicles"]["count"] = 20
        code, events = collector.run(plan)
        assert code == 0, [event for event in events if event["event"] == "error"]
        return Ride(EpisodeLog(tmp_path / name))

    return drive


def test_the_ego_drives_gently_at_the_limit_and_through_lights(ride: Callable[..., Ride]) -> None:
    gentle = ride("gentle", steps=900)
    assert np.percentile(np.abs(gentle.felt), 95, axis=0).max() <= 3.0
    assert max(gentle.jerk) <= 6.0
    assert np.max(gentle.speed / gentle.limit) == pytest.approx(1.0, abs=0.08)
    assert np.all(gentle.speed[-600:].reshape(-1, 300).max(axis=1) > 2.0)  # it goes on
    assert np.linalg.norm(np.diff(gentle.places, axis=0), axis=1).sum() > 250.0


def test_the_ego_waits_at_red_and_starts_at_green(ride: Callable[..., Ride]) -> None:
    ego = {"blueprint": "vehicle.tesla.model3", "spawn_index": START_BEFORE_RED}
    waiting = ride("waiting", steps=600, ego=ego)
    red = np.array([light == "Red" for light in waiting.light])
    stands = red & (waiting.speed < 0.05)
    assert stands.sum() > 2 * FPS
    assert np.max(waiting.speed[red]) < 2.0
    after = int(np.nonzero(stands)[0][-1]) + 1
    assert np.max(waiting.speed[after : after + 8 * FPS]) > 4.0


def test_the_same_plan_drives_the_same_and_comfort_can_be_left_out(
    ride: Callable[..., Ride],
) -> None:
    gentle, again = ride("gentle", steps=300), ride("again", steps=300)
    assert np.array_equal(gentle.places, again.places)
    harsh = ride("harsh", steps=300, gently=False)
    assert harsh.strong[0] > 1.3 * gentle.strong[0]


def test_somebody_who_steps_out_is_braked_for_as_hard_as_ever(ride: Callable[..., Ride]) -> None:
    event = {
        "kind": "pedestrian_crosses", "at_s": 0.0, "distance_m": 35.0, "trigger_m": 8.0,
        "speed_m_s": 2.5, "side": "right", "parked_car": False,
    }  # fmt: skip
    hard = ride("hard", steps=150, scenario={"kind": "autopilot", "events": [event]})
    assert hard.felt[:, 0].min() < -7.0
