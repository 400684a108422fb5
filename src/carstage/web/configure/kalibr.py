"""Cameras out of a ``camchain.yaml`` of Kalibr.

Source: Kalibr's wiki, "YAML formats": ``intrinsics`` are fu, fv, pu, pv; ``T_cn_cnm1`` takes points
of the camera before to this one's, both in optical axes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from carstage.errors import BadInputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_CAMERA = re.compile(r"cam\d+")
MODELS = {"radtan": "plumb_bob", "equidistant": "equidistant", "none": ""}
"""ROS's names of the distortion by Kalibr's."""


def is_camchain(document: Mapping[str, Any]) -> bool:
    """Whether this is a chain of cameras."""
    return any(_CAMERA.fullmatch(str(key)) for key in document)


def camera_infos(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The cameras as ``camera_info`` of ROS would have them.

    Raises:
        BadInputError: a projection that is no pinhole's.
    """
    infos = []
    named = [str(key) for key in document if _CAMERA.fullmatch(str(key))]
    for name in sorted(named, key=lambda name: int(name.removeprefix("cam"))):
        camera = document[name]
        if camera.get("camera_model") != "pinhole" or camera["distortion_model"] not in MODELS:
            raise BadInputError(
                f"{name}: {camera.get('camera_model')}-{camera['distortion_model']} is not known.",
                "Use pinhole-radtan or pinhole-equi.",
            )
        fx, fy, cx, cy = (float(value) for value in camera["intrinsics"])
        width, height = camera["resolution"]
        infos.append(
            {
                "camera_name": name,
                "image_width": width,
                "image_height": height,
                "camera_matrix": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
                "distortion_model": MODELS[camera["distortion_model"]],
                "distortion_coefficients": camera.get("distortion_coeffs", []),
            }
        )
    return infos


def first_from_others(document: Mapping[str, Any]) -> list[NDArray[np.float64]]:
    """``(4, 4)`` pose of each camera in the first one's, CARLA's sensor axes."""
    import numpy as np

    from carstage.geometry import OPTICAL_FROM_SENSOR

    axes = np.eye(4)
    axes[:3, :3] = OPTICAL_FROM_SENSOR
    here, poses = np.eye(4), []
    for number in range(len(camera_infos(document))):
        step = document[f"cam{number}"].get("T_cn_cnm1") if number else None
        if number and step is None:
            raise BadInputError(f"cam{number}: T_cn_cnm1 is missing.", "Choose a whole camchain.")
        here = here if step is None else here @ np.linalg.inv(np.array(step, dtype=np.float64))
        poses.append(axes.T @ here @ axes)
    return poses
