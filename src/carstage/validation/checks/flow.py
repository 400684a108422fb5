"""Optical flow is what depth and the camera's motion make it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.calibration import SensorCalibration
from carstage.geometry import (
    OPTICAL_FROM_SENSOR,
    invert_pose,
    transform_points,
)
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelledBox

MIN_MOTION_PX = 1.0
ABSOLUTE_TOLERANCE_PX = 0.5
RELATIVE_TOLERANCE = 0.05
MIN_SHARE = 0.75
MIN_PIXELS = 500
BOX_MARGIN_M = 0.3
_SKY_M = 900.0
_STRIDE = 4


@dataclass(slots=True)
class FlowFigures:
    """Pixels of what stands that should have moved in the image, and those that did so."""

    compared: int = 0
    agreeing: int = 0

    @property
    def share(self) -> float | None:
        """Share of pixels that agree; ``None`` where too few can be compared."""
        return self.agreeing / self.compared if self.compared >= MIN_PIXELS else None

    def add(self, other: FlowFigures) -> None:
        """Add the counts of another frame."""
        self.compared += other.compared
        self.agreeing += other.agreeing

    def to_dict(self) -> dict[str, float | None]:
        """For the report."""
        share = self.share
        return {"pixels": self.compared, "share": None if share is None else round(share, 6)}


def compare_with_motion(
    flow_px: NDArray[np.float32],
    depth_m: NDArray[np.float32],
    camera: SensorCalibration,
    before_from_now: NDArray[np.float64],
    boxes: Sequence[LabelledBox],
) -> FlowFigures:
    """Count the pixels whose flow is the motion of a surface that stands.

    A pixel is lifted by its depth, moved into the camera's frame of the step before and projected:
    the difference is its flow, to 0.5 px + 5 %. Left out are the sky, everything inside a labelled
    box grown by 0.3 m, and what moves by less than 1 px. One pixel in 16 is looked at.

    Args:
        flow_px: ``(H, W, 2)`` pixels right and down since the step before.
        depth_m: ``(H, W)`` of the depth camera with the same pose and intrinsics.
        camera: the calibration in this frame.
        before_from_now: ``(4, 4)`` this frame's camera in the camera of the step before, CARLA
            sensor axes.
        boxes: the frame's objects.
    """
    height, width = depth_m.shape
    v, u = (grid.ravel() for grid in np.mgrid[_STRIDE // 2 : height : _STRIDE,
                                              _STRIDE // 2 : width : _STRIDE])  # fmt: skip
    depth = depth_m[v, u].astype(np.float64)
    solid = depth < _SKY_M
    u, v, depth = u[solid], v[solid], depth[solid]
    uv = np.column_stack([u + 0.5, v + 0.5])
    in_sensor = camera.back_project(uv, depth) @ OPTICAL_FROM_SENSOR
    stands = ~_inside(transform_points(camera.ego_from_sensor, in_sensor), boxes)
    before = transform_points(before_from_now, in_sensor) @ OPTICAL_FROM_SENSOR.T
    uv_before = camera.project(before)
    ahead = ~np.isnan(uv_before[:, 0])
    expected = uv - uv_before
    length = np.linalg.norm(expected, axis=1)
    found = flow_px[v, u].astype(np.float64)
    compared = stands & ahead & (length >= MIN_MOTION_PX) & np.isfinite(found).all(axis=1)
    error = np.linalg.norm(found[compared] - expected[compared], axis=1)
    allowed = ABSOLUTE_TOLERANCE_PX + RELATIVE_TOLERANCE * length[compared]
    return FlowFigures(int(compared.sum()), int((error <= allowed).sum()))


def _inside(points_ego: NDArray[np.float64], boxes: Sequence[LabelledBox]) -> NDArray[np.bool_]:
    inside = np.zeros(len(points_ego), np.bool_)
    for box in boxes:
        reach = float(np.linalg.norm(box.extent)) + BOX_MARGIN_M
        near = np.flatnonzero(
            np.abs(points_ego - box.ego_from_box[:3, 3]).max(axis=1, initial=0.0) <= reach
        )
        local = np.abs(transform_points(invert_pose(box.ego_from_box), points_ego[near]))
        inside[near] |= (local <= box.extent + BOX_MARGIN_M).all(axis=1)
    return inside


def check_flow(camera_id: str, figures: FlowFigures, findings: Findings) -> None:
    """Report a flow camera of which less than three quarters of the pixels agree (``flow``)."""
    share = figures.share
    if share is not None and share < MIN_SHARE:
        findings.add(
            "flow",
            f"the flow of {share:.1%} of {figures.compared} pixels of what stands is the motion "
            f"that depth and the camera's poses give; at least {MIN_SHARE:.0%} must be",
            sensor=camera_id,
        )
