"""Silhouettes of boxes: near-plane clipping, convex hulls, clipping to the image, areas.

Polygons have at most some twenty vertices, so plain Python floats beat array calls here.
A convex solid cut by a half-space is convex: the hull of what is left in front of the camera is
its exact silhouette. Projecting eight corners without the cut flips points behind the camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from carstage.geometry.boxes import EDGES
from carstage.geometry.coordinates import FloatArray

Point = tuple[float, float]
Rectangle = tuple[float, float, float, float]


def clip_to_near_plane(corners_optical: ArrayLike, z_near_m: float) -> FloatArray:
    """Vertices ``(M, 3)`` of a box's part with ``Z >= z_near_m``; M may be 0.

    Args:
        corners_optical: ``(8, 3)`` corners in optical axes, in LibCarla's order (m).
        z_near_m: the near plane.
    """
    corners = np.asarray(corners_optical, dtype=np.float64)
    kept = corners[:, 2] >= z_near_m
    if kept.all():
        return corners
    points = [corners[kept]]
    for a, b in EDGES:
        if kept[a] != kept[b]:
            share = (z_near_m - corners[a, 2]) / (corners[b, 2] - corners[a, 2])
            cut = corners[a] + share * (corners[b] - corners[a])
            cut[2] = z_near_m
            points.append(cut[None])
    return np.concatenate(points)


def convex_hull(points: ArrayLike) -> list[Point]:
    """Convex hull of ``(N, 2)`` points by Andrew's monotone chain; no repeated first vertex.

    Fewer than three vertices come back when all points lie on a line.
    """
    rows: list[list[float]] = np.asarray(points, dtype=np.float64).tolist()
    ordered = sorted({(row[0], row[1]) for row in rows})
    if len(ordered) < 3:
        return ordered

    def chain(sequence: Sequence[Point]) -> list[Point]:
        hull: list[Point] = []
        for point in sequence:
            while len(hull) >= 2:
                (ax, ay), (bx, by) = hull[-2], hull[-1]
                if (bx - ax) * (point[1] - ay) - (by - ay) * (point[0] - ax) > 0.0:
                    break
                hull.pop()
            hull.append(point)
        return hull

    lower, upper = chain(ordered), chain(ordered[::-1])
    return lower[:-1] + upper[:-1]


def polygon_area(polygon: Sequence[Point]) -> float:
    """Area of a simple polygon (shoelace formula), never negative."""
    if len(polygon) < 3:
        return 0.0
    # Relative to a vertex: huge coordinates would cancel badly otherwise.
    x0, y0 = polygon[0]
    twice = 0.0
    for (ax, ay), (bx, by) in pairwise(polygon[1:]):
        twice += (ax - x0) * (by - y0) - (bx - x0) * (ay - y0)
    return abs(twice) / 2.0


def clip_polygon_to_image(polygon: Sequence[Point], width: int, height: int) -> list[Point]:
    """Part of a convex polygon inside ``[0, width] x [0, height]`` (Sutherland-Hodgman)."""
    clipped = list(polygon)
    for axis, bound, keep_above in (
        (0, 0.0, True),
        (0, float(width), False),
        (1, 0.0, True),
        (1, float(height), False),
    ):
        if not clipped:
            break
        clipped = _clip_half_plane(clipped, axis, bound, keep_above)
    return clipped


def _clip_half_plane(
    polygon: list[Point], axis: int, bound: float, keep_above: bool
) -> list[Point]:
    """The polygon's part with ``point[axis] >= bound`` (or ``<=``)."""
    sign = 1.0 if keep_above else -1.0
    result: list[Point] = []
    previous = polygon[-1]
    previous_side = sign * (previous[axis] - bound)
    for point in polygon:
        side = sign * (point[axis] - bound)
        if (side >= 0.0) != (previous_side >= 0.0):
            share = previous_side / (previous_side - side)
            other = 1 - axis
            crossing = previous[other] + share * (point[other] - previous[other])
            result.append((bound, crossing) if axis == 0 else (crossing, bound))
        if side >= 0.0:
            result.append(point)
        previous, previous_side = point, side
    return result


def bounds(polygon: Sequence[Point]) -> Rectangle:
    """Axis-aligned bounds ``(x0, y0, x1, y1)`` of a polygon with at least one vertex."""
    xs, ys = zip(*polygon, strict=True)
    return min(xs), min(ys), max(xs), max(ys)
