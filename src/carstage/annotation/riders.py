"""Riders: labelled by their pixels, next to the two-wheeler whose box holds both.

From CARLA 0.9.14 on, a rider's pixels carry a tag for riders and the two-wheeler's id. CARLA has
no 3D box of a rider, so there is none here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from carstage.annotation.classes import RIDER
from carstage.annotation.pixels import ModalMask, PixelVisibility
from carstage.annotation.rig import LabelledCamera
from carstage.annotation.stage_vo import LEVEL_UNKNOWN
from carstage.annotation.tracks import rider_track
from carstage.spec import LabelsSpec

_UNKNOWN_IN_CAMERA: Final = (
    "center_cam",
    "location",
    "dimensions",
    "rotation_y",
    "alpha",
    "rotation_cam",
    "corners_uv",
    "bbox_amodal_unclipped",
    "bbox_amodal",
    "n_visible",
    "n_occluded",
    "n_outside",
    "n_behind",
    "truncation_paper",
    "truncated",
    "outside_px",
    "front_px",
    "hull_px",
    "amodal_px",
    "occlusion_ratio",
    "visible_stage_vo",
)
_UNKNOWN: Final = (
    "box_center",
    "box_rotation_deg",
    "box_quaternion",
    "box_extent",
    "box_center_ego",
    "box_yaw_ego",
    "box_rotation_ego_deg",
    "distance_ego",
    "visibility",
    "visibility_token",
    "light_state",
)


def rider_pixels(two_wheeler: PixelVisibility, tag: Any, rider_tag: int) -> ModalMask | None:
    """The pixels of a two-wheeler that show its rider; None without any.

    Args:
        two_wheeler: what is visible of both.
        tag: ``(H, W)`` uint8 semantic tags.
        rider_tag: the riders' tag.
    """
    whole = two_wheeler.mask
    if whole is None:
        return None
    height, width = whole.crop.shape
    tags = tag[whole.y0 : whole.y0 + height, whole.x0 : whole.x0 + width]
    crop = whole.crop & (tags == rider_tag)
    rows, columns = np.flatnonzero(crop.any(axis=1)), np.flatnonzero(crop.any(axis=0))
    if not len(rows):
        return None
    tight = crop[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return ModalMask(tight, whole.x0 + int(columns[0]), whole.y0 + int(rows[0]))


def rider_camera_row(
    two_wheeler: Mapping[str, Any],
    mask: ModalMask,
    camera: LabelledCamera,
    labels: LabelsSpec,
    *,
    has_points: bool,
) -> dict[str, Any]:
    """The rider's row of ``camera_objects.parquet``.

    Args:
        two_wheeler: the row of the two-wheeler.
        mask: the rider's pixels.
        camera: that sees them.
        labels: what the spec asks of them.
        has_points: whether enough LiDAR points lie in the two-wheeler's box.
    """
    count = int(mask.crop.sum())
    return {
        **two_wheeler,
        **dict.fromkeys(_UNKNOWN_IN_CAMERA),
        "track_id": rider_track(two_wheeler["track_id"]),
        "bbox_modal": list(mask.bounds()) if labels.boxes_2d else None,
        "mask_modal": mask.rle(camera.width, camera.height) if labels.boxes_2d else None,
        "visible_px": count,
        "occluded": LEVEL_UNKNOWN,
        "occluded_px": LEVEL_UNKNOWN,
        "amodal_method": "none",
        "visible_pixel": count >= labels.min_visible_px,
        "visible": count >= labels.min_visible_px and has_points,
    }


def rider_object_row(two_wheeler: Mapping[str, Any], rider_tag: int) -> dict[str, Any]:
    """The rider's row of ``objects.parquet``: pose and motion are the two-wheeler's."""
    track = rider_track(two_wheeler["track_id"])
    return {
        **two_wheeler,
        **dict.fromkeys(_UNKNOWN),
        "track_id": track,
        "instance_uid": f"{two_wheeler['episode_id']}:{track}",
        "class": RIDER,
        "box_source": "none",
        "num_lidar_points": [],
        "num_radar_points": [],
        "parent_track_id": two_wheeler["track_id"],
        "semantic_tags": [rider_tag],
        "is_ego": False,
    }
