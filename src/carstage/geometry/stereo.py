"""Rectified stereo pairs and their disparity.

Of two pinhole cameras of equal intrinsics and direction, one to the right of the other by the
baseline ``b``, a point at the depth ``z`` lies ``d = f_x b / z`` px further left in the right
picture (R. Szeliski, Computer Vision, 2nd edition, equation 12.1).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.geometry.coordinates import FloatArray, invert_pose

STEPS_PER_PX: Final = 256.0
"""A disparity of d px is stored as 256 d, as KITTI's benchmark of 2015 does; 0 is none."""
_FARTHEST_M: Final = 999.0
"""CARLA's depth ends at 1000 m: there is nothing."""
_SAME_M, _SAME_ROTATION = 1e-4, 1e-6
_SLACK_M, _SLACK_SHARE = 0.05, 0.01


@dataclass(frozen=True, slots=True)
class StereoCamera:
    """A pinhole camera that may be one of a pair.

    Attributes:
        id: name of the sensor.
        carrier: what it is fixed to; cameras of different ones are no pair.
        width, height: of its pictures (px).
        k: ``(3, 3)`` intrinsics.
        carrier_from_sensor: ``(4, 4)`` pose, CARLA's left-handed axes (m).
    """

    id: str
    carrier: object
    width: int
    height: int
    k: FloatArray
    carrier_from_sensor: FloatArray


@dataclass(frozen=True, slots=True)
class CameraPair:
    """A rectified pair.

    Attributes:
        left, right: the cameras.
        baseline_m: distance of the two.
    """

    left: StereoCamera
    right: StereoCamera
    baseline_m: float

    @property
    def focal_px(self) -> float:
        """Focal length of both along a row."""
        return float(self.left.k[0, 0])


def stereo_baseline_m(left: StereoCamera, right: StereoCamera) -> float | None:
    """How far the right camera is to the right of the left one; None: they are no pair."""
    same = (left.width, left.height) == (right.width, right.height) and np.allclose(left.k, right.k)
    if not same or left.carrier != right.carrier:
        return None
    apart = invert_pose(left.carrier_from_sensor) @ right.carrier_from_sensor
    ahead, beside, up = apart[:3, 3].tolist()
    level = abs(ahead) < _SAME_M and abs(up) < _SAME_M and beside > _SAME_M
    return beside if level and np.allclose(apart[:3, :3], np.eye(3), atol=_SAME_ROTATION) else None


def stereo_pairs(cameras: Sequence[StereoCamera]) -> tuple[CameraPair, ...]:
    """The pairs of a rig: each camera with the nearest one to its right, in at most one pair.

    Of several ways the shortest baselines come first, then those of earlier cameras.
    """
    found = [
        CameraPair(left, right, baseline_m)
        for left in cameras
        for right in cameras
        if (baseline_m := stereo_baseline_m(left, right)) is not None
    ]
    return tuple(_disjoint(sorted(found, key=lambda pair: round(pair.baseline_m, 4))))


def _disjoint(pairs: Sequence[CameraPair]) -> Iterator[CameraPair]:
    taken: set[str] = set()
    for pair in pairs:
        ids = {pair.left.id, pair.right.id}
        if not ids & taken:
            taken |= ids
            yield pair


def disparity_steps(
    depth_m: NDArray[np.float32], focal_px: float, baseline_m: float
) -> NDArray[np.uint16]:
    """A picture's disparity, in 256ths of a pixel; 0 where there is none to be stored.

    Args:
        depth_m: ``(H, W)`` depth along the optical axis.
        focal_px: of both cameras.
        baseline_m: distance of the two.
    """
    with np.errstate(divide="ignore"):
        steps = np.rint(STEPS_PER_PX * focal_px * baseline_m / depth_m.astype(np.float64))
    fits = (depth_m < _FARTHEST_M) & (steps >= 1.0) & (steps <= np.iinfo(np.uint16).max)
    return np.where(fits, steps, 0.0).astype(np.uint16)


def seen_by_both(
    steps: NDArray[np.uint16], depth_m: NDArray[np.float32], right_depth_m: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """``(H, W)`` which of the left picture's pixels the right camera sees, too.

    What counts is the farthest of the right picture's pixel and its two neighbours in the row.

    Args:
        steps: disparity in 256ths of a pixel.
        depth_m, right_depth_m: ``(H, W)`` of both cameras.
    """
    height, width = steps.shape
    row, column = np.mgrid[:height, :width]
    there = np.floor(column + 0.5 - steps / STEPS_PER_PX).astype(np.int64)
    inside = (there >= 0) & (steps > 0)
    farthest = np.max(
        [right_depth_m[row, np.clip(there + k, 0, width - 1)] for k in (-1, 0, 1)], axis=0
    )
    return np.asarray(inside & (depth_m <= farthest * (1.0 + _SLACK_SHARE) + _SLACK_M))
