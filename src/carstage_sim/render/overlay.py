"""Debug shapes in a finished picture: lines as ribbons of their width, points as squares.

They are unlit, as CARLA's are, and stand behind what is nearer than they: the picture's own depths
say what.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import kernel

_BEHIND_M = 0.03
"""A shape this little behind a surface still shows: lines are drawn on roads."""


@kernel
def _draw(ends, size, is_point, colour, focal, near, depth, pixels):  # type: ignore[no-untyped-def]
    """Draw shapes one after the other; ``ends (S, 2, 3)`` forward, right, up from the camera."""
    height, width = pixels.shape[0], pixels.shape[1]
    for s in range(ends.shape[0]):
        ax, ay, az = ends[s, 0, 0], ends[s, 0, 1], ends[s, 0, 2]
        bx, by, bz = ends[s, 1, 0], ends[s, 1, 1], ends[s, 1, 2]
        if ax < near and bx < near:
            continue
        if ax < near or bx < near:
            share = (near - ax) / (bx - ax)
            cy, cz = ay + share * (by - ay), az + share * (bz - az)
            if ax < near:
                ax, ay, az = near, cy, cz
            else:
                bx, by, bz = near, cy, cz
        u0, v0 = width / 2 + focal * ay / ax, height / 2 - focal * az / ax
        u1, v1 = width / 2 + focal * by / bx, height / 2 - focal * bz / bx
        if is_point[s]:
            r0 = r1 = size[s] / 2
        else:
            r0 = max(size[s] / 2 * focal / ax, 0.5)
            r1 = max(size[s] / 2 * focal / bx, 0.5)
        reach = max(r0, r1) + 0.5
        du, dv = u1 - u0, v1 - v0
        square = du * du + dv * dv
        first = max(math.floor(min(v0, v1) - reach), 0)
        last = min(math.ceil(max(v0, v1) + reach), height)
        for row in range(first, last):
            y = row + 0.5
            # The part of the line that comes near this row, and so the pixels that it may cover.
            low, high = 0.0, 1.0
            if abs(dv) > 1e-9:
                one, other = (y - reach - v0) / dv, (y + reach - v0) / dv
                low, high = max(min(one, other), 0.0), min(max(one, other), 1.0)
            left = min(u0 + low * du, u0 + high * du) - reach
            right = max(u0 + low * du, u0 + high * du) + reach
            for column in range(
                max(math.floor(max(left, -1.0)), 0),
                min(math.ceil(min(right, width + 1.0)), width),
            ):
                x = column + 0.5
                share = 0.0
                if square > 1e-9:
                    share = ((x - u0) * du + (y - v0) * dv) / square
                    share = min(max(share, 0.0), 1.0)
                away_x, away_y = x - u0 - share * du, y - v0 - share * dv
                if is_point[s]:
                    away = max(abs(away_x), abs(away_y))
                else:
                    away = math.sqrt(away_x * away_x + away_y * away_y)
                cover = min(r0 + share * (r1 - r0) + 0.5 - away, 1.0)
                if cover <= 0.0:
                    continue
                distance = 1.0 / (1.0 / ax + share * (1.0 / bx - 1.0 / ax))
                if distance > depth[row, column] + _BEHIND_M:
                    continue
                for channel in range(3):
                    before = pixels[row, column, channel]
                    pixels[row, column, channel] = int(
                        before + cover * (colour[s, channel] - before) + 0.5
                    )


def draw_shapes(
    ends: NDArray[np.float64],
    size: NDArray[np.float32],
    is_point: NDArray[np.bool_],
    colour: NDArray[np.uint8],
    *,
    focal_px: float,
    near_m: float,
    depth: NDArray[np.float32],
    pixels: NDArray[np.uint8],
) -> None:
    """Draw debug shapes into a picture.

    Args:
        ends: ``(S, 2, 3)`` ends of lines, metres forward, right and up from the camera.
        size: ``(S,)`` width of lines in metres, side of points in pixels.
        is_point: ``(S,)`` which of them are points, at their first end.
        colour: ``(S, 3)`` sRGB.
        focal_px: focal length.
        near_m: what is nearer than this along the optical axis is not drawn.
        depth: ``(H, W)`` metres along the optical axis of what the picture shows.
        pixels: ``(H, W, 3)`` sRGB, written to.
    """
    _draw(
        np.ascontiguousarray(ends, np.float64),
        size.astype(np.float64),
        is_point,
        colour.astype(np.float64),
        float(focal_px),
        float(near_m),
        depth,
        pixels,
    )
