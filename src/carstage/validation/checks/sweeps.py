"""Points of a sweeping LiDAR were measured in their turn, and the sensor's motion is undone."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.calibration import SensorCalibration
from carstage.geometry import FloatArray
from carstage.geometry.sweep_motion import SweepMotion
from carstage.sensor_kinds.columns import SweepPoint
from carstage.validation.checks.findings import Findings

SWEEPING: Final = "sweeping_lidar"
_OFF_RAD: Final = 3e-4
"""Ten times what whole microseconds turn a head of 20 Hz; a column is 6e-3 rad wide."""
_OFF_M: Final = 0.01
_OFF_SHARE: Final = 1e-4
_FASTEST_M_S: Final = 100.0
"""What is faster was put elsewhere; the sensor then has not moved."""


def check_sweep(
    points: NDArray[np.float32],
    lidar: SensorCalibration,
    motion: SweepMotion | None,
    k: int,
    findings: Findings,
) -> None:
    """Report points off their lasers or their turn, or with motion left (check ``sweep_motion``).

    Args:
        points: ``(N, 9)`` as the LiDAR's files have them.
        lidar: its calibration.
        motion: over the sweep, by the poses of this frame and the one before; None: not known.
        k: the frame.
        findings: where problems go.
    """
    if not len(points):
        return
    measured = points[:, SweepPoint.X_MEASURED :].astype(np.float64)
    age_s = -points[:, SweepPoint.TIME].astype(np.float64)
    wrong = {
        "are measured after the frame or at no time of the sweep": _out_of_turn(
            measured, age_s, lidar
        ),
        "lie on another laser than their ring says": _off_laser(measured, points, lidar),
    }
    if motion is not None and float(np.linalg.norm(motion.velocity)) < _FASTEST_M_S:
        still = motion.undone(measured, age_s)
        off_m = np.linalg.norm(still - points[:, :3], axis=1)
        allowed_m = _OFF_M + _OFF_SHARE * np.linalg.norm(measured, axis=1)
        wrong["are not where the sensor's motion puts them"] = off_m > allowed_m
    for what, which in wrong.items():
        if which.any():
            findings.add(
                "sweep_motion",
                f"{int(which.sum())} of {len(points)} points {what}",
                frame=k,
                sensor=lidar.id,
            )


def _out_of_turn(
    measured: FloatArray, age_s: FloatArray, lidar: SensorCalibration
) -> NDArray[np.bool_]:
    """Whose azimuth is not the head's at its time; where it ends is what most points say."""
    field = np.radians(_number(lidar, "horizontal_fov", 360.0))
    turned = _number(lidar, "rotation_frequency", 10.0) * field * age_s
    x, y, z = measured.T
    end = np.arctan2(y, x) + turned
    middle = end[np.argsort(np.mod(end, field))[len(end) // 2]]
    off = np.abs(np.mod(end - middle + field / 2.0, field) - field / 2.0)
    # A point above the sensor has an azimuth that float32 does not tell.
    level = np.hypot(x, y) / np.maximum(np.sqrt(x * x + y * y + z * z), 1e-9)
    return np.asarray((off * level > _OFF_RAD) | (age_s <= 0.0))


def _off_laser(
    measured: FloatArray, points: NDArray[np.float32], lidar: SensorCalibration
) -> NDArray[np.bool_]:
    top, bottom = _number(lidar, "upper_fov", 10.0), _number(lidar, "lower_fov", -30.0)
    step = (top - bottom) / max(_number(lidar, "channels", 32.0) - 1.0, 1.0)
    laser = np.radians(top - points[:, SweepPoint.RING].astype(np.float64) * step)
    x, y, z = measured.T
    return np.asarray(np.abs(np.arctan2(z, np.hypot(x, y)) - laser) > _OFF_RAD)


def _number(lidar: SensorCalibration, name: str, usual: float) -> float:
    return float(lidar.attributes.get(name, usual))
