"""Points of a flash LiDAR lie on its beams within its range, and have tags that there are."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.calibration import SensorCalibration
from carstage.geometry.flash_beams import beam_angles
from carstage.sensor_kinds import sensor_kind
from carstage.sensor_kinds.columns import TaggedPoint
from carstage.tags import TAGS_0_9_14
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.sweeps import SWEEPING

_OFF_BEAM_RAD: Final = 1e-5
"""Ten times what float32 moves a point."""
_SIGMAS: Final = 6.0
"""Noise never exceeds that."""


def is_comparable(lidar: SensorCalibration) -> bool:
    """Whether each point is a surface in the middle of its beam, as a depth image has it."""
    flash = lidar.flash
    if flash is None:
        return lidar.kind != SWEEPING
    wide = max(flash.horizontal_divergence_deg, flash.vertical_divergence_deg) > 0.0
    return not (flash.false_return_rate or (wide and flash.samples > 1))


def check_beams(
    points: NDArray[np.floating[Any]], lidar: SensorCalibration, k: int, findings: Findings
) -> None:
    """Report points that are on no beam or out of range, and too many (check ``flash_beams``).

    Args:
        points: ``(N, 3)`` or wider, in the sensor's axes (m).
        lidar: its calibration.
        k: the frame.
        findings: where problems go.
    """
    flash = lidar.flash
    if flash is None or not len(points):
        return
    x, y, z = points[:, :3].astype(np.float64).T
    ranges = np.sqrt(x * x + y * y + z * z)
    azimuth, elevation = beam_angles(flash)
    off = np.maximum(
        _off(np.arctan2(y, x), azimuth), _off(np.arcsin(z / np.maximum(ranges, 1e-9)), elevation)
    )
    slack_m = _SIGMAS * flash.noise_stddev_m + 1e-3
    far = (ranges > flash.range_m + slack_m) | (ranges < flash.min_range_m - slack_m)
    for wrong, what in (
        (int((off > _OFF_BEAM_RAD).sum()), "lie on no beam"),
        (int(far.sum()), "are nearer or farther than it measures"),
        (max(0, len(points) - flash.most_points), "are more than its beams have"),
    ):
        if wrong:
            findings.add(
                "flash_beams", f"{wrong} of {len(points)} points {what}", frame=k, sensor=lidar.id
            )


def check_point_tags(
    points: NDArray[np.floating[Any]], lidar: SensorCalibration, k: int, findings: Findings
) -> None:
    """Report tags of points that no table has (check ``flash_tags``).

    Args:
        points: ``(N, 6)``, see :class:`carstage.sensor_kinds.columns.TaggedPoint`.
        lidar: its calibration.
        k: the frame.
        findings: where problems go.
    """
    if not sensor_kind(lidar.kind).tags_points:
        return
    unknown = int((~np.isin(points[:, TaggedPoint.TAG], list(TAGS_0_9_14))).sum())
    if unknown:
        findings.add(
            "flash_tags",
            f"{unknown} of {len(points)} points have a tag that no class has",
            frame=k,
            sensor=lidar.id,
        )


def _off(angle: NDArray[np.float64], beams: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances of angles to the nearest of equally spaced ones, rad."""
    step = (beams[-1] - beams[0]) / (len(beams) - 1) if len(beams) > 1 else 1.0
    place = np.clip(np.rint((angle - beams[0]) / step), 0, len(beams) - 1).astype(np.intp)
    return np.asarray(np.abs(angle - beams[place]), dtype=np.float64)
