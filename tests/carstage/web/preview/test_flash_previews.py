"""Previews of flash LiDARs are points, though what is recorded are depth pictures."""

from __future__ import annotations

import numpy as np
import pytest

from carstage.config import parse_config
from carstage.plan.rig import plan_sensors
from carstage.rawlog.tail import NewRecord
from carstage.spec import SensorSpec
from carstage.web.configure.carla_sensors import read_sensors
from carstage.web.preview.previewer import draw_sensor
from carstage.web.preview.sensor_picture import sensor_picture


def flash_sensor(fov_deg: float) -> SensorSpec:
    attributes = f"{{columns: 40, rows: 10, samples: 1, horizontal_fov_deg: {fov_deg}}}"
    text = f"rig: {{sensors: [{{id: F, kind: flash_lidar, attributes: {attributes}}}]}}"
    return next(s for s in plan_sensors(parse_config(text)) if s.id == "F")


def wall(sensor: SensorSpec, distance_m: float) -> NewRecord:
    width, height = (int(sensor.attributes[f"image_size_{axis}"]) for axis in "xy")
    code = round(distance_m / 1000.0 * (2**24 - 1))
    pixel = bytes([code >> 16, (code >> 8) & 255, code & 255, 255])
    return NewRecord(3, {"width": width, "height": height, "fov_deg": 0.0}, pixel * width * height)


@pytest.mark.parametrize(("fov_deg", "count"), [(60.0, 400), (360.0, 100)])
def test_a_preview_has_the_points_that_the_picture_ahead_holds(fov_deg: float, count: int) -> None:
    sensor = flash_sensor(fov_deg)
    drawn = np.frombuffer(draw_sensor(sensor, "0.9.16", wall(sensor, 8.0)), "<f4").reshape(-1, 4)
    assert len(drawn) == count
    np.testing.assert_allclose(drawn[:, 0], 8.0, atol=1e-3)
    assert sensor_picture(sensor, "0.9.16", wall(sensor, 8.0), 320)[:2] == b"\xff\xd8"


def test_a_depth_camera_of_carlas_is_read_as_one() -> None:
    (sensor,), _ = read_sensors('[{"type": "sensor.camera.depth", "id": "D", "x": 1.0}]')
    assert sensor["kind"] == "depth"
