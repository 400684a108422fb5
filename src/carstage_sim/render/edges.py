"""Which pixels one ray does not do justice to: edges of objects, of sides, and of contrast."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.caster import Hits, Packets, RayCaster, picture_packets
from carstage_sim.render.scene import Frame
from carstage_sim.render.simd import PACKET

_ROWS = 16
"""Rows of pixels per piece of work."""
_BENT = np.float32(0.9)
"""Cosine between the normals of two neighbours below which they show different sides."""


@device
def _apart(codes, y, x, v, u):  # type: ignore[no-untyped-def]
    """Largest difference of two pixels' codes."""
    most = np.int32(0)
    for channel in range(3):
        # As signed numbers: the compiler takes the difference of unsigned ones for unsigned.
        one, other = np.int32(codes[y, x, channel]), np.int32(codes[v, u, channel])
        most = np.maximum(most, abs(one - other))
    return most


@device
def _unlike(static, actors, row, triangle, i, j):  # type: ignore[no-untyped-def]
    """Whether two hits are on different objects, materials or sides."""
    if row[i] != row[j]:
        return True
    if triangle[i] == triangle[j]:
        return False
    surfaces = static if row[i] < 0 else actors
    a, b = triangle[i], triangle[j]
    if surfaces.object_id[a] != surfaces.object_id[b]:
        return True
    if surfaces.material[a] != surfaces.material[b]:
        return True
    f = surfaces.flat
    return f[a, 0] * f[b, 0] + f[a, 1] * f[b, 1] + f[a, 2] * f[b, 2] < _BENT


@kernel
def _mark(static, actors, row, triangle, codes, strong, weak, first, last, marked):  # type: ignore[no-untyped-def]
    """Mark the pixels of some rows, and those right below, that differ too much from a neighbour.

    Bands that run side by side may both mark a pixel, with the same mark.
    """
    height, width = codes.shape[0], codes.shape[1]
    for y in range(first, last):
        for x in range(width):
            i = y * width + x
            for below in range(2):
                v, u = y + below, x + 1 - below
                if v >= height or u >= width:
                    continue
                apart = _apart(codes, y, x, v, u)
                if apart > strong or (
                    apart > weak and _unlike(static, actors, row, triangle, i, v * width + u)
                ):
                    marked[i] = True
                    marked[v * width + u] = True


@kernel
def _gather(marked, order, starts, room, edges, begins):  # type: ignore[no-untyped-def]
    """Numbers of the marked pixels, square after square, in groups of at most ``room``."""
    count, groups = 0, 0
    begins[0] = 0
    for square in range(starts.shape[0] - 1):
        for place in range(starts[square], starts[square + 1]):
            if not marked[order[place]]:
                continue
            if count - begins[groups] == room:
                groups += 1
                begins[groups] = count
            edges[count] = order[place]
            count += 1
        if count > begins[groups]:
            groups += 1
            begins[groups] = count
    return count, groups


@kernel
def _aim_again(directions, edges, offsets, first, last, rays):  # type: ignore[no-untyped-def]
    samples = offsets.shape[0]
    for e in range(first, last):
        for k in range(samples):
            for axis in range(3):
                rays[e * samples + k, axis] = directions[edges[e], axis] + offsets[k, axis]


def rough_pixels(
    caster: RayCaster,
    frame: Frame,
    hits: Hits,
    codes: NDArray[np.uint8],
    *,
    strong: int,
    weak: int,
    samples: int,
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Pixels to sample again, and where groups of them begin whose rays run side by side.

    Args:
        caster: runs the kernels.
        frame: what was seen.
        hits: of the pixel centres, row by row.
        codes: ``(H, W, 4)`` uint8 of the pixel centres.
        strong: difference to a neighbour, in codes, above which both pixels count.
        weak: the same for neighbours on different objects, materials or sides.
        samples: rays that each is to be sampled with.
    """
    height, width = codes.shape[:2]
    marked = np.zeros(height * width, np.bool_)

    def mark(first: int, last: int) -> None:
        _mark(
            frame.static, frame.actors, hits.row, hits.triangle, codes, strong, weak, first, last,
            marked,
        )  # fmt: skip

    caster.in_bands(height, mark, _ROWS)
    packets = picture_packets(width, height)
    edges = np.empty(height * width, np.int32)
    begins = np.empty(height * width + 1, np.int32)
    room = max(PACKET // samples, 1)
    count, groups = _gather(marked, packets.order, packets.starts, room, edges, begins)
    return edges[:count], begins[: groups + 1]


def sampled_again(
    caster: RayCaster,
    hits: Hits,
    edges: NDArray[np.int32],
    begins: NDArray[np.int32],
    offsets: NDArray[np.float32],
) -> tuple[NDArray[np.float32], Packets]:
    """Directions of the other rays through some pixels, and which of them run side by side.

    Args:
        caster: runs the kernels.
        hits: of the pixel centres.
        edges, begins: of :func:`rough_pixels`.
        offsets: ``(K, 3)`` from the direction through a pixel's centre to each of its other rays.
    """
    rays = np.empty((len(edges) * len(offsets), 3), np.float32)

    def aim(first: int, last: int) -> None:
        _aim_again(hits.directions, edges, offsets, first, last, rays)

    caster.in_bands(len(edges), aim)
    return rays, Packets(np.arange(len(rays), dtype=np.int32), begins * np.int32(len(offsets)))
