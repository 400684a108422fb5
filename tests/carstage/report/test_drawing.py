"""Boxes are drawn where they are, also where they reach past the camera."""

from __future__ import annotations

import numpy as np
import pytest

from carstage.dataset.calibration import SensorCalibration
from carstage.geometry import intrinsics, pose_matrix
from carstage.report.drawing import draw_boxes_3d
from carstage.validation.checks.labels import LabelledBox

WIDTH, HEIGHT = 640, 360
RED = (255, 0, 0)
CAMERA = SensorCalibration(
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
    fov_deg=90.0,
    k=intrinsics(WIDTH, HEIGHT, 90.0),
)


def drawn(center: list[float], extent: list[float]) -> np.ndarray:
    """Pixels that the edges of a box along the camera's axis cover."""
    pose = pose_matrix(center, [0.0, 0.0, 0.0])
    box = LabelledBox(1, pose, np.array(extent), frozenset(), {}, False)
    picture = draw_boxes_3d(np.zeros((HEIGHT, WIDTH, 3), np.uint8), CAMERA, [(box, RED)])
    return np.asarray(picture)[..., 0] == 255


@pytest.mark.parametrize("half_length_m", [5.0, 50.0])
def test_an_edge_that_passes_the_camera_keeps_its_direction(half_length_m: float) -> None:
    """The edge at 1.5 m to the right, 0.5 m below runs through the middle with slope 1 / 3."""
    red = drawn([0.0, 2.0, -1.0], [half_length_m, 0.5, 0.5])
    for u in (450, 550, 630):
        v = round(180 + (u - 320) / 3)
        assert red[v - 2 : v + 3, u].any(), u


def test_a_box_behind_the_camera_draws_nothing() -> None:
    assert not drawn([-20.0, 0.0, 0.0], [2.0, 1.0, 1.0]).any()


def test_a_box_beside_the_view_draws_nothing() -> None:
    assert not drawn([5.0, 60.0, 0.0], [2.0, 1.0, 1.0]).any()
