"""Boxes in the picture of a labelled camera, whatever its camera model."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.rig import LabelledCamera
from carstage.annotation.silhouette import (
    Silhouette,
    corner_regions,
    may_be_in_image,
    pixel_regions,
    silhouettes,
)
from carstage.geometry import FloatArray, Lens, bounds, length, lens_outline, pixel_rays, project
from carstage.geometry.coordinates import arctan2

Region = tuple[int, int, int, int]


def near_picture(camera: LabelledCamera, corners_optical: FloatArray) -> NDArray[np.bool_]:
    """Which of ``(N, 8, 3)`` boxes may be in the picture; a cheap test before the exact one."""
    if camera.lens is None:
        return may_be_in_image(corners_optical, camera.k, camera.width, camera.height)
    center = corners_optical.mean(axis=1)
    radius = length(corners_optical[:, 0] - center)
    away = length(center)
    across = np.sqrt(center[:, 0] ** 2 + center[:, 1] ** 2)
    share = np.minimum(radius / np.maximum(away, 1e-9), 1.0)
    # The ball around a box spans asin(radius / distance), which is less than pi / 2 of the share.
    nearest = arctan2(across, center[:, 2]) - math.pi / 2.0 * share
    return np.asarray((nearest <= camera.lens.max_angle_rad) | (radius >= away), dtype=np.bool_)


def outlines(camera: LabelledCamera, corners_optical: FloatArray) -> list[Silhouette | None]:
    """Outlines of ``(N, 8, 3)`` boxes; None of those that are not in the picture."""
    if camera.lens is None:
        return silhouettes(corners_optical, camera.k, camera.width, camera.height)
    return [_lens_silhouette(corners, camera.lens) for corners in corners_optical]


def regions(camera: LabelledCamera, corners_optical: FloatArray) -> list[Region]:
    """Whole pixels x0, y0, x1, y1 that hold the outlines of ``(N, 8, 3)`` boxes."""
    if camera.lens is None:
        return pixel_regions(corners_optical, camera.k, camera.width, camera.height)
    return [_lens_region(corners, camera.lens) for corners in corners_optical]


def wide_regions(camera: LabelledCamera, corners_optical: FloatArray) -> list[Region]:
    """Whole pixels around ``(N, 8, 3)`` boxes, which may be more than :func:`regions` gives."""
    if camera.lens is None:
        return corner_regions(corners_optical, camera.k, camera.width, camera.height)
    return regions(camera, corners_optical)


def corner_pixels(camera: LabelledCamera, corners_optical: FloatArray) -> FloatArray:
    """Pixel coordinates ``(..., 2)`` of points; NaN where the picture's model shows none."""
    if camera.lens is None:
        return project(corners_optical, camera.k)
    return camera.lens.project(corners_optical)


def corner_depths(camera: LabelledCamera, corners_optical: FloatArray) -> FloatArray:
    """Depths ``(...)`` of points as the camera's depth picture has them (m)."""
    if camera.lens is None:
        return corners_optical[..., 2]
    return camera.lens.depth(corners_optical)


def rays_of(camera: LabelledCamera) -> FloatArray | None:
    """``(H, W, 3)`` rays of its pixels, see ``Lens.rays``; None of a pinhole."""
    return None if camera.lens is None else pixel_rays(camera.lens)


def _lens_silhouette(corners: FloatArray, lens: Lens) -> Silhouette | None:
    outline = lens_outline(corners, lens)
    if outline is None:
        return None
    return Silhouette(
        bbox_unclipped=bounds(outline.polygon),
        bbox=outline.bounds_inside,
        truncated=outline.truncated,
        crosses_near=outline.cut,
    )


def _lens_region(corners: FloatArray, lens: Lens) -> Region:
    outline = lens_outline(corners, lens)
    if outline is None:
        return (0, 0, 0, 0)
    x0, y0, x1, y1 = outline.bounds_inside
    # A side between two points of the outline may bend out by a part of a pixel.
    return (
        max(0, math.floor(x0) - 1),
        max(0, math.floor(y0) - 1),
        min(lens.width, math.ceil(x1) + 1),
        min(lens.height, math.ceil(y1) + 1),
    )
