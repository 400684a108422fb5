"""Motion of sweeping LiDARs is checked where the frame before is the tick before."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from carstage.geometry import pose_matrix
from carstage.geometry.sweep_motion import SweepMotion
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.frames import FrameChecks

STEP_S, SPEED_M_S = 0.1, 10.0


def sweep() -> np.ndarray:
    """A point of the level laser, measured half a tick ago."""
    motion = SweepMotion(np.array([SPEED_M_S, 0.0, 0.0]), np.zeros(3))
    measured, age_s = np.array([[20.0, 0.0, 0.0]]), np.array([STEP_S / 2.0])
    still = motion.undone(measured, age_s)
    return np.column_stack([still, [1.0], -age_s, [0.0], measured]).astype(np.float32)


@pytest.mark.parametrize(
    ("ticks", "moved_m", "wrong"), [(1, 1.0, False), (1, 2.0, True), (2, 2.0, False)]
)
def test_a_missed_tick_is_no_wrong_motion(ticks: int, moved_m: float, wrong: bool) -> None:
    attributes = {"upper_fov": "0", "lower_fov": "-10", "channels": "2"}
    calibration = SimpleNamespace(id="LIDAR", attributes=attributes)
    lidar: Any = SimpleNamespace(id="LIDAR", kind="sweeping_lidar", calibration=calibration)
    findings = Findings("episode")
    spec = SimpleNamespace(step_s=STEP_S, save_every=1, fps=1.0 / STEP_S)
    checks: Any = SimpleNamespace(
        _episode=SimpleNamespace(spec=spec),
        _poses={"LIDAR": {k: pose_matrix([k * moved_m, 0, 0], [0, 0, 0]) for k in range(2)}},
        _times_s={0: 0.0, 1: ticks * STEP_S},
        _findings=findings,
    )
    FrameChecks._check_sweep(checks, lidar, 1, sweep())
    assert bool(findings.problems()) is wrong
