"""Which labelled cameras of a specification are rectified stereo pairs."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from carstage.geometry import intrinsics, is_pinhole, pose_matrix
from carstage.geometry.stereo import CameraPair, StereoCamera, stereo_pairs
from carstage.sensor_kinds.model import COLOUR
from carstage.spec import SensorSpec
from carstage.spec.sensors import EGO, ON_MAP, RIGID

DISPARITY_FOLDER = "disparity"


def disparity_name(sensor_id: str, k: int) -> str:
    """Path of the disparity of a camera's picture of frame ``k``, below the episode's folder."""
    return f"{DISPARITY_FOLDER}/{sensor_id}/{k:06d}.png"


def planned_pairs(sensors: Iterable[SensorSpec]) -> tuple[CameraPair, ...]:
    """The pairs among labelled colour cameras without distortion that keep their place.

    Args:
        sensors: of the ego, or of an agent that is taken for it.
    """
    return stereo_pairs([camera for one in sensors if (camera := _camera(one)) is not None])


def _camera(sensor: SensorSpec) -> StereoCamera | None:
    fixed = sensor.attachment == RIGID and sensor.attach_to in (EGO, ON_MAP)
    if not (fixed and sensor.labelled and sensor.content == COLOUR):
        return None
    lens, attributes = sensor.lens, sensor.attributes
    if lens is not None:
        if not lens.is_pinhole:
            return None
        width, height = lens.width, lens.height
        k = np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])
    elif is_pinhole(attributes):
        width, height = int(attributes["image_size_x"]), int(attributes["image_size_y"])
        k = intrinsics(width, height, float(attributes["fov"]))
    else:
        return None
    pose = sensor.pose
    place = pose_matrix(
        [pose.x_m, pose.y_m, pose.z_m], [pose.pitch_deg, pose.yaw_deg, pose.roll_deg]
    )
    return StereoCamera(sensor.id, sensor.attach_to, width, height, k, place)
