"""Patches in one picture: their outlines, and how much of them nothing stands before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import (
    Z_NEAR_M,
    FloatArray,
    clip_polygon_to_image,
    optical_from_world,
    project,
    rotate,
    transform_points,
)

_PX_DIGITS, _M_DIGITS, _SHARE_DIGITS = 2, 3, 4
_TOLERANCE_M, _TOLERANCE_SHARE = 0.03, 0.005
"""How far the depth image may be off the patch where the patch itself is seen."""


@dataclass(frozen=True, slots=True, eq=False)
class PatchView:
    """A camera in one frame.

    Attributes:
        k: ``(3, 3)`` intrinsics of a pinhole.
        world_from_sensor: ``(4, 4)`` in CARLA's axes.
        depth_m: ``(H, W)`` distance along the optical axis.
        range_m: patches whose middle is farther are left out.
    """

    k: FloatArray
    world_from_sensor: FloatArray
    depth_m: NDArray[np.float32]
    range_m: float


def patch_in_view(corners: FloatArray, view: PatchView) -> dict[str, Any] | None:
    """Columns of ``patches.parquet`` that follow from a patch's corners and a camera.

    Args:
        corners: ``(4, 3)`` top left, top right, bottom right, bottom left, in the world.
        view: the camera.

    Returns:
        None where the camera is behind the patch, or it is out of the picture.
    """
    optical = transform_points(optical_from_world(view.world_from_sensor), corners)
    distance_m = float(np.sqrt((optical.mean(axis=0) ** 2).sum()))
    normal = np.cross(optical[1] - optical[0], optical[3] - optical[0])
    length = float(np.sqrt((normal**2).sum()))
    middle = optical.mean(axis=0)
    facing = float((normal * middle).sum())
    if facing <= 0.0 or distance_m > view.range_m:
        return None
    near = _before(optical, Z_NEAR_M)
    if len(near) < 3:
        return None
    height, width = view.depth_m.shape
    places = [(float(u), float(v)) for u, v in project(near, view.k, 0.0)]
    outline = np.array(clip_polygon_to_image(places, width, height)).reshape(-1, 2)
    if len(outline) < 3:
        return None
    pixels, visible = _seen(optical, normal, outline, view)
    uv = np.round(outline, _PX_DIGITS) + 0.0
    return {
        "u": uv[:, 0].tolist(),
        "v": uv[:, 1].tolist(),
        "pixels": pixels,
        "visible_share": round(visible / pixels, _SHARE_DIGITS) if pixels else 0.0,
        "distance": round(distance_m, _M_DIGITS),
        "facing": round(facing / (length * distance_m), _SHARE_DIGITS),
    }


def _before(corners: FloatArray, z_near_m: float) -> FloatArray:
    """What of a polygon is ahead of the near plane (Sutherland and Hodgman 1974)."""
    kept: list[FloatArray] = []
    for here, ahead in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        a, b = here[2] - z_near_m, ahead[2] - z_near_m
        if a >= 0.0:
            kept.append(here)
        if (a < 0.0) != (b < 0.0):
            kept.append(here + a / (a - b) * (ahead - here))
    return np.array(kept).reshape(-1, 3)


def _seen(
    optical: FloatArray, normal: FloatArray, outline: FloatArray, view: PatchView
) -> tuple[int, int]:
    """Pixels whose middle shows the patch's place, and those of them that show the patch."""
    height, width = view.depth_m.shape
    left, top = np.clip(np.floor(outline.min(axis=0)).astype(int), 0, [width, height])
    right, bottom = np.clip(np.ceil(outline.max(axis=0)).astype(int), 0, [width, height])
    u, v = np.meshgrid(np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5)
    k = view.k
    rays = np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones_like(u)], axis=-1)
    slope = (rays * normal).sum(axis=-1)
    ahead = np.abs(slope) > 1e-12
    depth = np.where(ahead, (normal * optical[0]).sum() / np.where(ahead, slope, 1.0), -1.0)
    away = rays * depth[..., None] - optical[0]
    inside = depth >= Z_NEAR_M
    for side in (optical[1] - optical[0], optical[3] - optical[0]):
        share = (away * side).sum(axis=-1) / (side**2).sum()
        inside &= (share >= 0.0) & (share <= 1.0)
    found = view.depth_m[top:bottom, left:right]
    off = np.abs(found - depth) <= _TOLERANCE_M + _TOLERANCE_SHARE * depth
    return int(inside.sum()), int((inside & off).sum())


def faces_of(
    corners: tuple[FloatArray, FloatArray],
    rotation: FloatArray,
    location: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """``(4, 3)`` corners in the world of a patch on the front and on the back of its board.

    Args:
        corners: the same in the board's frame.
        rotation: ``(3, 3)`` world_from_board.
        location: ``(3,)`` of the board, world metres.
    """
    front, back = (np.round(rotate(rotation, one) + location, 4) for one in corners)
    return front, back
