"""The outline of a box in an image: 2D boxes and geometric truncation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import (
    Z_NEAR_M,
    FloatArray,
    Rectangle,
    bounds,
    clip_polygon_to_image,
    clip_to_near_plane,
    convex_hull,
    polygon_area,
    project,
)


@dataclass(frozen=True, slots=True)
class Silhouette:
    """The convex outline of a box's part in front of the camera.

    Attributes:
        bbox_unclipped: bounds of the outline, may exceed the image (px).
        bbox: bounds of the outline's part inside the image; not the clipped bounds (px).
        truncated: share of the outline's area outside the image.
        crosses_near: the box reaches behind the near plane, so the outline is huge.
    """

    bbox_unclipped: Rectangle
    bbox: Rectangle
    truncated: float
    crosses_near: bool


def silhouette(
    corners_optical: FloatArray,
    k: FloatArray,
    width: int,
    height: int,
    z_near_m: float = Z_NEAR_M,
) -> Silhouette | None:
    """Outline of a box; None when no part of it falls into the image.

    Args:
        corners_optical: ``(8, 3)`` corners in optical axes, in LibCarla's order (m).
        k: ``(3, 3)`` intrinsics.
        width: of the image (px).
        height: of the image (px).
        z_near_m: the near plane.
    """
    front = clip_to_near_plane(corners_optical, z_near_m)
    if len(front) < 3:
        return None
    outline = convex_hull(project(front, k, z_near_m))
    inside = clip_polygon_to_image(outline, width, height)
    area_inside = polygon_area(inside)
    if area_inside <= 0.0:
        return None
    return Silhouette(
        bbox_unclipped=bounds(outline),
        bbox=bounds(inside),
        truncated=min(1.0, max(0.0, 1.0 - area_inside / polygon_area(outline))),
        crosses_near=bool((corners_optical[:, 2] < z_near_m).any()),
    )


def silhouettes(
    corners_optical: FloatArray, k: FloatArray, width: int, height: int
) -> list[Silhouette | None]:
    """:func:`silhouette` of ``(N, 8, 3)`` boxes.

    A box that is wholly in the image, as most are, has the bounds of its corners; its polygon need
    not be made.
    """
    lows, highs, whole = _corner_bounds(corners_optical, k, width, height)
    found: list[Silhouette | None] = []
    for corners, low, high, inside in zip(corners_optical, lows, highs, whole, strict=True):
        if inside:
            box = (low[0], low[1], high[0], high[1])
            found.append(Silhouette(box, box, truncated=0.0, crosses_near=False))
        else:
            found.append(silhouette(corners, k, width, height))
    return found


def pixel_regions(
    corners_optical: FloatArray, k: FloatArray, width: int, height: int
) -> list[tuple[int, int, int, int]]:
    """Whole pixels x0, y0, x1, y1 that hold the silhouettes of ``(N, 8, 3)`` boxes.

    Some pixel of each box should be in the image; the region of others may be empty.
    """
    lows, highs, whole = _corner_bounds(corners_optical, k, width, height)
    regions = []
    for corners, low, high, inside in zip(corners_optical, lows, highs, whole, strict=True):
        x0, y0, x1, y1 = (*low, *high)
        if not inside:
            # Of what reaches beyond the image only the part in it bounds the work.
            outline = silhouette(corners, k, width, height)
            full = (0.0, 0.0, float(width), float(height))
            x0, y0, x1, y1 = full if outline is None else outline.bbox
        regions.append((math.floor(x0), math.floor(y0), math.ceil(x1), math.ceil(y1)))
    return regions


def corner_regions(
    corners_optical: FloatArray, k: FloatArray, width: int, height: int
) -> list[tuple[int, int, int, int]]:
    """Whole pixels around the corners of ``(N, 8, 3)`` boxes, as far as they are in the image.

    Wider than :func:`pixel_regions` where a box leaves the image, and quicker; the whole image
    where one reaches behind the camera.
    """
    lows, highs, _ = _corner_bounds(corners_optical, k, width, height)
    regions = []
    for low, high in zip(lows, highs, strict=True):
        if any(math.isnan(value) for value in (*low, *high)):
            regions.append((0, 0, width, height))
            continue
        x0, y0 = (max(0, math.floor(value)) for value in low)
        x1, y1 = min(width, math.ceil(high[0])), min(height, math.ceil(high[1]))
        regions.append((x0, y0, x1, y1))
    return regions


def _corner_bounds(
    corners_optical: FloatArray, k: FloatArray, width: int, height: int
) -> tuple[list[list[float]], list[list[float]], list[bool]]:
    """Bounds of the projected corners of boxes, and which boxes are wholly in the image."""
    uv = project(corners_optical, k)
    low, high = uv.min(axis=1), uv.max(axis=1)  # NaN where a corner is behind
    whole = (low >= 0.0).all(axis=-1) & (high <= (width, height)).all(axis=-1)
    return low.tolist(), high.tolist(), whole.tolist()


def may_be_in_image(
    corners_optical: FloatArray,
    k: FloatArray,
    width: int,
    height: int,
    z_near_m: float = Z_NEAR_M,
) -> NDArray[np.bool_]:
    """Which of ``N`` boxes no side of the view frustum excludes.

    A cheap test before the exact one: false only if all eight corners lie beyond one side.

    Args:
        corners_optical: ``(N, 8, 3)``.
        k: ``(3, 3)`` intrinsics.
        width: of the image (px).
        height: of the image (px).
        z_near_m: the near plane.
    """
    x, y, z = np.moveaxis(corners_optical, -1, 0)
    u = k[0, 0] * x + k[0, 2] * z
    v = k[1, 1] * y + k[1, 2] * z
    beyond = (z < z_near_m, u < 0.0, u > width * z, v < 0.0, v > height * z)
    excluded = np.stack([side.all(axis=-1) for side in beyond])
    return np.asarray(~excluded.any(axis=0), dtype=np.bool_)
