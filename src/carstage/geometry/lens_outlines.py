"""Outlines of boxes in pictures of a lens, where straight edges are curves.

Seen along the ray to its centre, or where that cuts it to its nearest point, a box is a convex
polygon of a pinhole. Its sides are divided, and their points go through the lens. What lies beyond
the lens's largest angle is replaced by the arc of its image circle that lies inside the outline.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.geometry.camera import Z_NEAR_M
from carstage.geometry.coordinates import FloatArray, arctan2, length, rotate
from carstage.geometry.lenses import Lens
from carstage.geometry.polygons import (
    Point,
    bounds,
    clip_polygon_to_image,
    clip_to_near_plane,
    convex_hull,
    polygon_area,
)

_STEPS: Final = 24
"""Parts of a side; of one that spans 90 degrees of a fisheye's 300 px, each is off by 0.16 px."""
_LONG_STEPS: Final = 120
"""Parts of each, where one spans more."""
_ARC_STEP_RAD: Final = math.radians(3.0)
_BACK_STEPS: Final = 8
_SAMPLES: Final = 48


@dataclass(frozen=True, slots=True)
class LensOutline:
    """The outline of a box in a picture.

    Attributes:
        polygon: the outline as far as the lens reaches, in pixel coordinates that may exceed the
            picture; of a picture that wraps, without a jump at its edge.
        inside: its parts inside the picture.
        truncated: share of the box's outline that is outside the picture, measured in the plane
            across the ray to the box's centre; where the box reaches behind that, to its nearest
            point.
        cut: a part is nearer than the near plane or beyond the lens's largest angle.
    """

    polygon: list[Point]
    inside: list[list[Point]]
    truncated: float
    cut: bool

    @property
    def bounds_inside(self) -> tuple[float, float, float, float]:
        """Bounds of the parts inside the picture."""
        return bounds([point for part in self.inside for point in part])


def lens_outline(corners_optical: FloatArray, lens: Lens) -> LensOutline | None:
    """Outline of a box; None when no part of it falls into the picture.

    Args:
        corners_optical: ``(8, 3)`` corners in optical axes, in LibCarla's order (m).
        lens: the camera model.
    """
    axes = _axes_towards(corners_optical.mean(axis=0))
    if (rotate(axes, corners_optical)[:, 2] < Z_NEAR_M).any():
        # No part of a box lies nearer, along that ray, than its nearest point.
        axes = _axes_towards(_nearest_point(corners_optical))
    front = clip_to_near_plane(rotate(axes, corners_optical), Z_NEAR_M)
    if len(front) < 3:
        return None
    hull = convex_hull(front[:, :2] / front[:, 2:])
    if len(hull) < 3:
        return None
    rays = rotate(axes.T, _along_sides(hull))
    seen = _angles(rays) <= lens.max_angle_rad
    if not seen.any():
        if not _contains(hull, axes, np.array([0.0, 0.0, 1.0])):
            return None
        rays = _circle(lens, 0.0, 2.0 * math.pi)
    elif not seen.all():
        rays = _with_arcs(rays, seen, lens, hull, axes)
    cut = not seen.all() or bool((rotate(axes, corners_optical)[:, 2] < Z_NEAR_M).any())
    if not lens.wraps and seen.all() and _contains(hull, axes, np.array([0.0, 0.0, -1.0])):
        return _around_picture(hull, axes, lens, cut=cut)
    polygon = _in_picture(rays, lens)
    inside = _inside(polygon, lens)
    if not inside:
        return None
    area = sum(polygon_area(_towards_box(part, lens, axes)) for part in inside)
    truncated = min(1.0, max(0.0, 1.0 - area / polygon_area(hull)))
    return LensOutline(polygon, inside, truncated if truncated > 1e-3 else 0.0, cut)


def _around_picture(
    hull: Sequence[Point], axes: FloatArray, lens: Lens, *, cut: bool
) -> LensOutline | None:
    """Outline of a box that the backward axis meets, of a lens that sees all directions.

    Its outline goes around what is not the box. All of the picture stands for what little there is
    of such a box at the picture's edges.
    """
    x0, y0, x1, y1 = bounds(hull)
    share = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    x, y = (one.ravel() for one in np.meshgrid(x0 + (x1 - x0) * share, y0 + (y1 - y0) * share))
    within = np.ones(len(x), np.bool_)
    for (ax, ay), (bx, by) in zip(hull, [*hull[1:], hull[0]], strict=True):
        within &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0
    rays = np.column_stack([x, y, np.ones(len(x))])[within]
    uv = lens.project(rotate(axes.T, rays))
    shown = ((uv >= 0.0) & (uv < [lens.width, lens.height])).all(axis=1)
    if not shown.any():
        return None
    w, h = float(lens.width), float(lens.height)
    picture = [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)]
    return LensOutline(picture, [picture], float(1.0 - shown.mean()), cut)


def _nearest_point(corners: FloatArray) -> FloatArray:
    """The point of a box ``(8, 3)`` that is nearest to the camera, or its centre, if that is in it.

    The corners 0, 1, 2 and 4 span its edges.
    """
    center: FloatArray = corners.mean(axis=0)
    nearest: FloatArray = center.copy()
    for corner in (1, 2, 4):
        half = 0.5 * (corners[corner] - corners[0])
        extent = max(float(length(half)), 1e-9)
        along = half / extent
        nearest = nearest + along * min(max(-float((center * along).sum()), -extent), extent)
    return nearest if float(length(nearest)) >= Z_NEAR_M else center


def _axes_towards(center: FloatArray) -> FloatArray:
    """``(3, 3)`` rotation whose third row looks along the ray to a point."""
    forward = center / max(float(length(center)), 1e-9)
    side = np.array([0.0, 1.0, 0.0]) if abs(forward[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    right = _cross(side, forward)
    right = right / float(length(right))
    return np.stack([right, _cross(forward, right), forward])


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _along_sides(hull: Sequence[Point]) -> FloatArray:
    """``(N, 3)`` unit rays along the sides of a polygon in the plane ``z = 1``."""
    corners = np.column_stack([np.array(hull), np.ones(len(hull))])
    corners = corners / length(corners)[:, None]
    following = np.roll(corners, -1, axis=0)
    steps = _STEPS if (corners * following).sum(axis=1).min() >= 0.0 else _LONG_STEPS
    share = np.arange(steps)[:, None] / steps
    along = corners[:, None] * (1.0 - share) + following[:, None] * share
    rays = along.reshape(-1, 3)
    return np.asarray(rays / length(rays)[:, None], dtype=np.float64)


def _angles(rays: FloatArray) -> FloatArray:
    return arctan2(np.sqrt(rays[:, 0] ** 2 + rays[:, 1] ** 2), rays[:, 2])


def _contains(hull: Sequence[Point], axes: FloatArray, ray: FloatArray) -> bool:
    """Whether a ray in optical axes passes through a box's outline."""
    x, y, z = rotate(axes, ray).tolist()
    if z <= 0.0:
        return False
    sides = zip(hull, [*hull[1:], hull[0]], strict=True)
    return all(
        (bx - ax) * (y / z - ay) - (by - ay) * (x / z - ax) >= 0.0 for (ax, ay), (bx, by) in sides
    )


def _circle(lens: Lens, start: float, end: float) -> FloatArray:
    """``(N, 3)`` rays at the lens's largest angle between two azimuths, both included."""
    count = max(2, math.ceil(abs(end - start) / _ARC_STEP_RAD))
    across, along = math.sin(lens.max_angle_rad), math.cos(lens.max_angle_rad)
    azimuths = [start + (end - start) * i / (count - 1) for i in range(count)]
    return np.array([[across * math.cos(a), across * math.sin(a), along] for a in azimuths])


def _with_arcs(
    rays: FloatArray,
    seen: NDArray[np.bool_],
    lens: Lens,
    hull: Sequence[Point],
    axes: FloatArray,
) -> FloatArray:
    """The outline with each run of rays beyond the lens replaced by an arc of its circle."""
    first = int(np.flatnonzero(seen & ~np.roll(seen, -1))[0]) + 1
    rays, seen = np.roll(rays, -first, axis=0), np.roll(seen, -first)
    azimuth = arctan2(rays[:, 1], rays[:, 0]).tolist()
    parts, begin = [], 0
    changes = [*(np.flatnonzero(seen[1:] != seen[:-1]) + 1).tolist(), len(seen)]
    for end in changes:
        if seen[begin]:
            parts.append(rays[begin:end])
        else:
            start, turn = azimuth[begin], azimuth[end - 1] - azimuth[begin]
            turn = math.remainder(turn, 2.0 * math.pi)
            other = turn - math.copysign(2.0 * math.pi, turn)
            middle = _circle(lens, start + turn / 2.0, start + turn / 2.0)[0]
            around = turn if _contains(hull, axes, middle) else other
            opposite = _circle(lens, start + other / 2.0, start + other / 2.0)[0]
            if around == other and not _contains(hull, axes, opposite):
                around = turn  # the box barely touches the circle
            parts.append(_circle(lens, start, start + around))
        begin = end
    return np.concatenate(parts)


def _in_picture(rays: FloatArray, lens: Lens) -> list[Point]:
    uv = lens.to_edge(rays)
    if not lens.wraps:
        return [(u, v) for u, v in uv.tolist()]
    # Without a jump: each step is the shorter way round.
    steps = np.diff(uv[:, 0], append=uv[:1, 0])
    steps -= lens.width * np.round(steps / lens.width)
    u = uv[0, 0] + np.concatenate([[0.0], np.cumsum(steps)])
    polygon = [(a, b) for a, b in zip(u[:-1].tolist(), uv[:, 1].tolist(), strict=True)]
    if abs(u[-1] - u[0]) > lens.width / 2.0:  # the outline goes around the upper or lower pole
        pole = 0.0 if uv[:, 1].mean() < lens.height / 2.0 else float(lens.height)
        polygon += [(float(u[-1]), float(uv[0, 1])), (float(u[-1]), pole), (float(u[0]), pole)]
    return polygon


def _inside(polygon: list[Point], lens: Lens) -> list[list[Point]]:
    shifts = (-lens.width, 0, lens.width) if lens.wraps else (0,)
    parts = []
    for shift in shifts:
        moved = [(u + shift, v) for u, v in polygon]
        part = clip_polygon_to_image(moved, lens.width, lens.height)
        if polygon_area(part) > 0.0:
            parts.append(part)
    return parts


def _towards_box(part: Sequence[Point], lens: Lens, axes: FloatArray) -> list[Point]:
    """A part of the picture in the plane across the ray to a box."""
    corners = np.array(part)
    share = np.arange(_BACK_STEPS)[:, None] / _BACK_STEPS
    along = corners[:, None] * (1.0 - share) + np.roll(corners, -1, axis=0)[:, None] * share
    # The image's very edge can round to beyond the lens: what has no ray there is left out.
    rays = lens.rays(along.reshape(-1, 2))
    rays = rotate(axes, rays[~np.isnan(rays[:, 0])])
    rays = rays[rays[:, 2] > 1e-6]
    return [(x, y) for x, y in (rays[:, :2] / rays[:, 2:]).tolist()]
