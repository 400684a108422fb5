"""One record of a sensor as the picture of its preview."""

from __future__ import annotations

import numpy as np

from carstage.geometry import pose_matrix, transform_points
from carstage.rawlog.tail import NewRecord
from carstage.report.drawing import birds_eye_view
from carstage.sensor_kinds import sensor_kind
from carstage.sensor_kinds.model import DETECTIONS
from carstage.spec import SensorSpec
from carstage.web.preview.previewer import draw_sensor
from carstage.web.preview.sensor_views import jpeg, scaled

_QUALITY = 85
_MOST_POINTS = 200_000


def sensor_picture(sensor: SensorSpec, server: str, record: NewRecord, width: int) -> bytes:
    """JPEG: of a camera what it sees, of LiDAR and radar their points from above."""
    drawn = draw_sensor(sensor, server, record, width, _MOST_POINTS)
    kind = sensor_kind(sensor.kind)
    if kind.is_camera:
        return drawn
    points = np.frombuffer(drawn, "<f4").reshape(-1, 4).astype(np.float64)
    pose = sensor.pose
    ego_from_sensor = pose_matrix(
        [pose.x_m, pose.y_m, pose.z_m], [pose.pitch_deg, pose.yaw_deg, pose.roll_deg]
    )
    places = transform_points(ego_from_sensor, points[:, :3])
    if kind.content == DETECTIONS:
        rates = points[:, 3].astype(np.float32)
        picture = birds_eye_view(np.zeros((0, 3)), [], [(places, rates)])
    else:
        picture = birds_eye_view(places, [])
    return jpeg(scaled(picture, width), _QUALITY)
