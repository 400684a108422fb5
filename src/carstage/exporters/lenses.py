"""Camera models in other formats."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.dataset import SensorCalibration
from carstage.errors import BadInputError

FIRST_CENTRE_PX: Final = 0.5
"""Where the centre of the first pixel is, in pixels that count from the picture's corner."""

ROS_MODELS: Final = {"brown_conrady": "plumb_bob", "kannala_brandt": "equidistant"}
"""Names of ``sensor_msgs/CameraInfo`` by the camera model."""
FOXGLOVE_MODELS: Final = {"brown_conrady": "plumb_bob", "kannala_brandt": "kannala_brandt"}
"""Names of ``foxglove.CameraCalibration``, which has no ``equidistant``."""


def opencv_matrix(camera: SensorCalibration) -> NDArray[np.float64]:
    """``(3, 3)`` intrinsics of pixels that count from the centre of the first one, as OpenCV's do.

    So do those of KITTI, nuScenes and ROS; a dataset's own count from the picture's corner.
    """
    matrix = np.array(camera.k, np.float64)
    matrix[:2, 2] -= FIRST_CENTRE_PX
    return matrix


def lens_entry(camera: SensorCalibration) -> dict[str, Any]:
    """A key ``lens`` with model and coefficients of a camera that has a lens, else nothing."""
    lens = camera.bent
    if lens is None:
        return {}
    return {"lens": {"model": lens.model, "distortion": list(lens.distortion)}}


def no_place_for(camera: SensorCalibration) -> BadInputError:
    """The error of a format that knows pinholes alone, or labelled pictures alone."""
    if camera.lens is None:
        return BadInputError(
            f"{camera.id!r} has a lens distortion of CARLA's own, so its pictures have no labels "
            "and no camera model.",
            "Use the format video or webdataset, or choose a camera without `lens_*` attributes.",
        )
    return BadInputError(
        f"This format has no place for the camera model {camera.lens.model} of {camera.id!r}.",
        "Use the format mcap, coco or webdataset, or choose a camera without distortion.",
    )


def has_named_model(camera: SensorCalibration) -> bool:
    """Whether ROS and Foxglove have a name for its camera model.

    They have none for CARLA's own lens distortion nor for panoramas. What a message said of such a
    camera would be a pinhole.
    """
    lens = camera.bent
    return camera.is_pinhole or (lens is not None and lens.model in ROS_MODELS)


def named_distortion(
    camera: SensorCalibration, names: Mapping[str, str]
) -> tuple[str, list[float]]:
    """Distortion model by its name in a format, and coefficients; empty without, or without a name.

    Coefficients are in OpenCV's order, ``k1 k2 p1 p2 k3`` and ``k1 k2 k3 k4``, as ROS and Foxglove
    have them.

    Args:
        camera: the camera.
        names: ``ROS_MODELS`` or ``FOXGLOVE_MODELS``.
    """
    lens = camera.bent
    if lens is None or lens.model not in names:
        return "", []
    return names[lens.model], list(lens.distortion)
