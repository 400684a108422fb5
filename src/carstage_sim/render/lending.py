"""Colours that the extra rays of a pixel take from pixels beside it instead of being shaded.

Only where that cannot be seen: from pixels whose centres show the same triangle, and only while
those agree with each other to a few codes. So textures, shadows and reflections are shaded wherever
they differ from pixel to pixel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.caster import Hits, Packets, RayCaster
from carstage_sim.render.packet_simd import PACKET

_FIXED: Any = np.float32(0.001)
_SHARE: Any = np.float32(0.0107)
"""A step of one 8-bit code in linear display light: a fixed part and a share of the light."""
_SAMPLE_CODES: Any = np.float32(6.0)
"""Codes by which pixels may differ whose colour a ray takes that is a third of its pixel."""


@device
def _like(colours, i, j, codes):  # type: ignore[no-untyped-def]
    """Whether two colours differ by at most so many codes."""
    for channel in range(3):
        a, b = colours[i, channel], colours[j, channel]
        if abs(a - b) > codes * (_FIXED + _SHARE * max(a, b)):
            return False
    return True


@kernel
def _lend(  # type: ignore[no-untyped-def]
    row, triangle, width, height, colours, edges, towards, row_of, triangle_of, first, last, again,
    open_,
):  # fmt: skip
    """Give the extra rays of pixels the colour of a pixel beside them, or leave them open."""
    samples = towards.shape[0]
    for e in range(first, last):
        pixel = edges[e]
        y, x = pixel // width, pixel % width
        for k in range(samples):
            ray = e * samples + k
            found = -1
            agree = True
            for place in range(4):
                u = x + towards[k, 0] * (place & 1)
                v = y + towards[k, 1] * (place >> 1)
                if u < 0 or v < 0 or u >= width or v >= height:
                    continue
                j = v * width + u
                if row[j] != row_of[ray] or triangle[j] != triangle_of[ray]:
                    continue
                if found < 0:
                    found = j
                agree = agree and _like(colours, found, j, _SAMPLE_CODES)
            open_[ray] = found < 0 or not agree
            if found >= 0 and agree:
                for channel in range(3):
                    again[ray, channel] = colours[found, channel]


@kernel
def _gather(open_, order, starts, chosen, begins):  # type: ignore[no-untyped-def]
    """The rays that are left open, in packets of those that run side by side."""
    count, groups = 0, 0
    begins[0] = 0
    for packet in range(starts.shape[0] - 1):
        if starts[packet + 1] - starts[packet] + count - begins[groups] > PACKET:
            groups += 1
            begins[groups] = count
        for place in range(starts[packet], starts[packet + 1]):
            if open_[order[place]]:
                chosen[count] = order[place]
                count += 1
    if count > begins[groups]:
        groups += 1
        begins[groups] = count
    return count, groups


def lent(
    caster: RayCaster,
    hits: Hits,
    size: tuple[int, int],
    colours: NDArray[np.float32],
    edges: NDArray[np.int32],
    offsets: NDArray[np.float32],
    again: Hits,
    packets: Packets,
    out: NDArray[np.float32],
) -> Packets:
    """Colour the extra rays that meet what pixels beside them show; which are still to be shaded.

    Args:
        caster: runs the kernels.
        hits: of the picture.
        size: its width and height.
        colours: ``(N, 3)`` of its pixels.
        edges: pixels that the extra rays go through, ``K`` for each.
        offsets: ``(K, 2)`` where, right and down from a pixel's centre; a ray takes colours from
            the four pixels whose centres are around it.
        again: hits of the extra rays.
        packets: which of them run side by side.
        out: ``(E * K, 3)`` receives their colours.
    """
    open_ = np.zeros(len(out), np.bool_)
    towards = np.where(offsets < 0.0, np.int32(-1), np.int32(1))

    def work(first: int, last: int) -> None:
        _lend(
            hits.row, hits.triangle, *size, colours, edges, towards, again.row, again.triangle,
            first, last, out, open_,
        )  # fmt: skip

    caster.in_bands(len(edges), work)
    chosen = np.empty(len(packets.order), np.int32)
    begins = np.empty(len(packets.starts), np.int32)
    count, groups = _gather(open_, packets.order, packets.starts, chosen, begins)
    return Packets(chosen[:count], begins[: groups + 1])
