"""What stands before a walker, counted again from a painted depth picture."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from carstage.dataset.calibration import SensorCalibration
from carstage.geometry import intrinsics
from carstage.validation.checks.labels import LabelledBox
from carstage.validation.checks.occluders import wrong_fronts

WIDTH, HEIGHT, AWAY_M = 320, 200, 20.0
HALF_M = np.array([0.2, 0.2, 0.9])


def walker() -> LabelledBox:
    pose = np.eye(4)
    pose[0, 3] = AWAY_M
    return LabelledBox(7, pose, HALF_M, frozenset({12}), {}, is_ego=False, is_capsule=True)


def camera() -> SensorCalibration:
    return SensorCalibration(
        id="CAM",
        kind="rgb",
        blueprint="sensor.camera.rgb",
        attributes={},
        attach_to="ego",
        attachment="rigid",
        carrier_from_sensor=np.eye(4),
        ego_from_sensor=np.eye(4),
        codec="png",
        labelled=True,
        depth=None,
        instance=None,
        width=WIDTH,
        height=HEIGHT,
        fov_deg=40.0,
        k=intrinsics(WIDTH, HEIGHT, 40.0),
    )


def picture(before_m: float) -> Any:
    """The walker's silhouette, its left half hidden by what is so near; nothing about it."""
    depth_m = np.full((HEIGHT, WIDTH), 100.0, np.float32)
    half_px = np.ceil(camera().k[0, 0] * HALF_M[1:] / (AWAY_M - HALF_M[0])).astype(int) + 1
    rows = slice(HEIGHT // 2 - half_px[1], HEIGHT // 2 + half_px[1])
    columns = slice(WIDTH // 2 - half_px[0], WIDTH // 2 + half_px[0])
    depth_m[rows, columns] = AWAY_M
    depth_m[rows, columns.start : WIDTH // 2] = before_m
    return depth_m


def row(front_px: int) -> dict[str, Any]:
    return {"track_id": 7, "front_px": front_px, "hull_px": 800}


@pytest.mark.parametrize("front_px", [0, 400])
def test_what_may_be_an_arm_is_counted_by_its_id_alone(front_px: int) -> None:
    """Without the instance picture it may be the walker's own, or of who walks beside."""
    depth_m = picture(AWAY_M - 0.5)
    assert wrong_fronts(camera(), [(row(front_px), walker())], depth_m) == []
    ids = np.where(depth_m < 99.0, np.uint16(8), np.uint16(0)).astype(np.uint16)
    found = wrong_fronts(camera(), [(row(front_px), walker())], depth_m, ids)
    assert bool(found) == (front_px == 0)


@pytest.mark.parametrize(("front_px", "is_wrong"), [(0, True), (400, False), (800, True)])
def test_what_is_nearer_than_an_arm_reaches_hides_a_walker(front_px: int, is_wrong: bool) -> None:
    found = wrong_fronts(camera(), [(row(front_px), walker())], picture(AWAY_M - 2.0))
    assert bool(found) == is_wrong
