"""Lines of a town in one picture: cut at its edges, and what of them nothing stands before."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import (
    Z_NEAR_M,
    FloatArray,
    multiply,
    optical_from_world,
    project,
    transform_points,
)
from carstage.lane_lines.town import AREAS, TownLine, TownLines

_PX_DIGITS, _M_DIGITS, _SHARE_DIGITS = 2, 3, 3
_TOLERANCE_M, _TOLERANCE_SHARE = 0.2, 0.01
"""How much farther than the depth image a place of the ground may be and still be seen."""
_SAMPLES: Final = 12
"""Of an area's visibility, along each side of a triangle of it."""


@dataclass(frozen=True, slots=True, eq=False)
class PictureView:
    """A camera in one frame.

    Attributes:
        k: ``(3, 3)`` intrinsics of a pinhole.
        world_from_sensor: ``(4, 4)`` in CARLA's axes.
        depth_m: ``(H, W)`` distance along the optical axis.
        range_m: lines farther along that axis are cut.
    """

    k: FloatArray
    world_from_sensor: FloatArray
    depth_m: NDArray[np.float32]
    range_m: float


def lines_in_view(town: TownLines, view: PictureView) -> list[dict[str, Any]]:
    """A row for each part of a line, and for each area, of which something is seen.

    Keys are columns of ``lane_lines.parquet`` but ``k`` and ``sensor_id``. Places are rounded to
    0.01 px and 1 mm.

    Args:
        town: what may be seen.
        view: the camera.
    """
    optical_from_map = optical_from_world(view.world_from_sensor)
    planes = _planes(view)
    # A place in view is no farther than the corner of the picture at the range.
    height, width = view.depth_m.shape
    half = np.array([width / view.k[0, 0], height / view.k[1, 1], 1.0])
    reach_m = view.range_m * float(np.sqrt((half**2).sum()))
    rows = []
    for line in town.near(view.world_from_sensor[:3, 3], reach_m):
        optical = transform_points(optical_from_map, line.places)
        is_area = line.kind in AREAS
        parts = _cut_area(optical, planes) if is_area else _cut_line(optical, planes)
        for number, part in enumerate(parts):
            seen = _seen(part, view)
            samples = _seen(_within(part), view) if is_area else seen
            if samples.any():
                rows.append(_row(line, number, part, seen, float(samples.mean()), view))
    return rows


def _row(
    line: TownLine,
    number: int,
    part: FloatArray,
    seen: NDArray[np.bool_],
    share: float,
    view: PictureView,
) -> dict[str, Any]:
    uv = np.round(project(part, view.k, 0.0), _PX_DIGITS) + 0.0
    places = np.round(part, _M_DIGITS) + 0.0
    return {
        "kind": line.kind,
        "map_id": line.map_id,
        "part": number,
        "type": line.type,
        "colour": line.colour,
        "width": line.width_m,
        "u": uv[:, 0].tolist(),
        "v": uv[:, 1].tolist(),
        "x": places[:, 0].tolist(),
        "y": places[:, 1].tolist(),
        "z": places[:, 2].tolist(),
        "visible": seen.astype(np.uint8).tolist(),
        "visible_share": round(share, _SHARE_DIGITS),
    }


def _planes(view: PictureView) -> FloatArray:
    """``(6, 4)`` factors of x, y, z and 1 in optical axes; what is in view is nowhere below 0."""
    height, width = view.depth_m.shape
    fx, fy, cx, cy = view.k[0, 0], view.k[1, 1], view.k[0, 2], view.k[1, 2]
    return np.array(
        [
            [0.0, 0.0, 1.0, -Z_NEAR_M],
            [0.0, 0.0, -1.0, view.range_m],
            [fx, 0.0, cx, 0.0],
            [-fx, 0.0, width - cx, 0.0],
            [0.0, fy, cy, 0.0],
            [0.0, -fy, height - cy, 0.0],
        ]
    )


def _sides(points: FloatArray, planes: FloatArray) -> FloatArray:
    """``(N, 6)`` how far points lie inside of each plane."""
    return multiply(points, np.ascontiguousarray(planes[:, :3].T)) + planes[:, 3]


def _cut_line(points: FloatArray, planes: FloatArray) -> list[FloatArray]:
    """The parts of a line within all planes (Cyrus and Beck 1978)."""
    sides = _sides(points, planes)
    a, b = sides[:-1], sides[1:]
    crossing = np.where(a == b, 0.0, a / np.where(a == b, 1.0, a - b))
    first = np.where(a < 0.0, crossing, 0.0).max(axis=1)
    last = np.where(b < 0.0, crossing, 1.0).min(axis=1)
    kept = ~((a < 0.0) & (b < 0.0)).any(axis=1) & (first < last)
    step = np.diff(points, axis=0)
    begin, end = points[:-1] + first[:, None] * step, points[:-1] + last[:, None] * step
    parts: list[list[FloatArray]] = []
    for number in np.flatnonzero(kept).tolist():
        goes_on = parts and number and kept[number - 1] and last[number - 1] == 1.0
        if not (goes_on and first[number] == 0.0):
            parts.append([begin[number]])
        whole = last[number] == 1.0
        parts[-1].append(points[number + 1] if whole else end[number])
    return [np.stack(part) for part in parts]


def _cut_area(corners: FloatArray, planes: FloatArray) -> list[FloatArray]:
    """The part of an area within all planes (Sutherland and Hodgman 1974); none, or one."""
    for plane in planes:
        side = _sides(corners, plane[None])[:, 0]
        following = np.roll(corners, -1, axis=0), np.roll(side, -1)
        kept: list[FloatArray] = []
        for here, ahead, a, b in zip(corners, following[0], side, following[1], strict=True):
            if a >= 0.0:
                kept.append(here)
            if (a < 0.0) != (b < 0.0):
                kept.append(here + a / (a - b) * (ahead - here))
        if len(kept) < 3:
            return []
        corners = np.stack(kept)
    return [corners]


def _within(corners: FloatArray) -> FloatArray:
    """Places evenly over the triangles from the first corner of an area to its sides."""
    first, second = np.meshgrid(*[(np.arange(_SAMPLES) + 0.5) / _SAMPLES] * 2)
    inside = first + second < 1.0
    a, b = first[inside][:, None], second[inside][:, None]
    found = [
        corners[0] + a * (one - corners[0]) + b * (other - corners[0])
        for one, other in pairwise(corners[1:])
    ]
    return np.concatenate(found)


def _seen(points: FloatArray, view: PictureView) -> NDArray[np.bool_]:
    """``(N,)`` whether nothing stands before points in the picture.

    The ground's depth changes within a pixel: what counts is the farthest of the pixel and the
    eight around it.
    """
    height, width = view.depth_m.shape
    uv = project(points, view.k, 0.0)
    column = np.clip(uv[:, 0], 0, width - 1).astype(np.int64)
    row = np.clip(uv[:, 1], 0, height - 1).astype(np.int64)
    farthest = np.zeros(len(points))
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            depth = view.depth_m[
                np.clip(row + down, 0, height - 1), np.clip(column + right, 0, width - 1)
            ]
            farthest = np.maximum(farthest, depth)
    limit = farthest * (1.0 + _TOLERANCE_SHARE) + _TOLERANCE_M
    return np.asarray(points[:, 2] <= limit)
