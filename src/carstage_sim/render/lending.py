"""Extra rays of a pixel, and colours that they take from pixels beside it.

A ray amid four pixels that show one surface has the colour between theirs: it is not traced. The
others are. Of those, a ray takes the colour of a pixel beside it only where that cannot be seen:
from pixels whose centres show the same triangle, and only while those agree with each other to a
few codes. So shadows and reflections along edges are shaded wherever they differ.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, inlined, kernel
from carstage_sim.render.caster import Hits, Packets, RayCaster
from carstage_sim.render.crew import Shared, do, do_step
from carstage_sim.render.edges import Rough, alike
from carstage_sim.render.packet_simd import PACKET
from carstage_sim.render.scene import Frame

_PACKETS = 64
"""Packets of extra rays per piece of work."""
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


@device
def _mix(  # type: ignore[no-untyped-def]
    static, actors, detail, row, triangle, width, height, colours, towards, shares, x, y, k, out
):
    """Give a pixel's ray the colour between four pixels; False where they show no one surface."""
    u, v = x + towards[k, 0], y + towards[k, 1]
    if u < 0 or v < 0 or u >= width or v >= height:
        return False
    i, beside, below, across = y * width + x, y * width + u, v * width + x, v * width + u
    if not (
        alike(static, actors, detail, row, triangle, i, beside)
        and alike(static, actors, detail, row, triangle, i, below)
        and alike(static, actors, detail, row, triangle, i, across)
    ):
        return False
    right, down = shares[k, 0], shares[k, 1]
    for channel in range(3):
        level = colours[i, channel]
        level += (colours[beside, channel] - level) * right
        under = colours[below, channel]
        under += (colours[across, channel] - under) * right
        out[channel] = level + (under - level) * down
    return True


@device
def _aim_part(directions, edges, offsets, wanted, rays, worker, first, last):  # type: ignore[no-untyped-def]
    samples = offsets.shape[0]
    for e in range(first, last):
        pixel = edges[e]
        for k in range(samples):
            ray = e * samples + k
            if wanted[ray]:
                for axis in range(3):
                    rays[ray, axis] = directions[pixel, axis] + offsets[k, axis]


@kernel
def aim_again(data, board, job, work):  # type: ignore[no-untyped-def]
    """Directions of the extra rays of some rough pixels.

    The data are ``(N, 3)`` float32 directions through the centres of the picture's pixels, ``(E,)``
    int32 numbers of the rough pixels, ``(K, 3)`` float32 from the direction through a pixel's
    centre to each other ray, ``(E * K,)`` which rays are to be traced, as the others stay
    unwritten, and ``(E * K, 3)`` float32 that receives them. Its items are the rough pixels.
    """
    do(_aim_part, data, board, job, work)


@device
def _mix_part(  # type: ignore[no-untyped-def]
    static, actors, detail, row, triangle, width, height, colours, edges, towards, shares,
    again, directions, offsets, rays, order, starts, open_, places, worker, first, last,
):  # fmt: skip
    samples = towards.shape[0]
    for packet in range(first, last):
        left = 0
        for e in range(starts[packet] // samples, starts[packet + 1] // samples):
            i = edges[e]
            y, x = i // width, i % width
            for k in range(samples):
                ray = e * samples + k
                open_[ray] = not _mix(
                    static, actors, detail, row, triangle, width, height, colours, towards, shares,
                    x, y, k, again[ray],
                )  # fmt: skip
                if open_[ray]:
                    left += 1
                    if directions.shape[0]:
                        for axis in range(3):
                            rays[ray, axis] = directions[i, axis] + offsets[k, axis]
        places[packet] = left


@device
def lends(  # type: ignore[no-untyped-def]
    row, triangle, width, height, colours, edges, towards, row_of, triangle_of, ray, again
):
    """Give an extra ray the colour of a pixel beside it; False where none has it."""
    samples = towards.shape[0]
    pixel, k = edges[ray // samples], ray % samples
    y, x = pixel // width, pixel % width
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
    if found < 0 or not agree:
        return False
    for channel in range(3):
        again[ray, channel] = colours[found, channel]
    return True


@device
def _lend_part(  # type: ignore[no-untyped-def]
    row, triangle, width, height, colours, edges, towards, row_of, triangle_of, again,
    order, starts, open_, places, worker, first, last,
):  # fmt: skip
    for packet in range(first, last):
        left = 0
        for place in range(starts[packet], starts[packet + 1]):
            ray = order[place]
            open_[ray] = not lends(
                row, triangle, width, height, colours, edges, towards, row_of, triangle_of, ray,
                again,
            )  # fmt: skip
            left += open_[ray]
        places[packet] = left


@device
def _place(starts, places, begins, sums):  # type: ignore[no-untyped-def]
    """Turn numbers of open rays into where those of each packet go; packets are filled up."""
    count, groups = 0, 0
    begins[0] = 0
    for packet in range(starts.shape[0] - 1):
        if starts[packet + 1] - starts[packet] + count - begins[groups] > PACKET:
            groups += 1
            begins[groups] = count
        left = places[packet]
        places[packet] = count
        count += left
    if count > begins[groups]:
        groups += 1
        begins[groups] = count
    sums[0], sums[1] = count, groups


@device
def _gather_part(order, starts, open_, places, chosen, worker, first, last):  # type: ignore[no-untyped-def]
    """The rays of some packets that are left open."""
    for packet in range(first, last):
        at = places[packet]
        for place in range(starts[packet], starts[packet + 1]):
            if open_[order[place]]:
                chosen[at] = order[place]
                at += 1


@inlined
def _gather_open(room, board, job, work):  # type: ignore[no-untyped-def]
    """Gather the rays that a job of the packets has left open, as a :class:`_Gathering` has it."""
    order, starts, open_, places, chosen, begins, sums = room
    _place(starts, places, begins, sums)
    gathering = order, starts, open_, places, chosen
    do_step(_gather_part, gathering, board, job, work, 1, work[1], work[2])


@kernel
def _mix_and_gather(data, board, job, work):  # type: ignore[no-untyped-def]
    """Mix the extra rays of pixels; aim, and gather, those that are left open.

    The data are those of mixing and of :class:`_Gathering`, and the items are the packets.
    """
    mixing, room = data
    do(_mix_part, (*mixing, *room[:4]), board, job, work)
    _gather_open(room, board, job, work)


@kernel
def _lend_and_gather(data, board, job, work):  # type: ignore[no-untyped-def]
    """Lend colours to the extra rays of pixels; gather those that are left open.

    The data are those of lending and of :class:`_Gathering`, and the items are the packets.
    """
    lending, room = data
    do(_lend_part, (*lending, *room[:4]), board, job, work)
    _gather_open(room, board, job, work)


class _Gathering(NamedTuple):
    """Rays, and room for those of them that are left open, in packets of their own.

    Attributes:
        order, starts: of all rays; see :class:`Packets`.
        open_: ``(M,)`` bool by the ray's number.
        places: ``(P,)`` int32 how many of each packet are left; then where they go in ``chosen``.
        chosen, begins: order and starts of those that are left.
        sums: ``(2,)`` int32 how many they are, and how many packets.
    """

    order: NDArray[np.int32]
    starts: NDArray[np.int32]
    open_: NDArray[np.bool_]
    places: NDArray[np.int32]
    chosen: NDArray[np.int32]
    begins: NDArray[np.int32]
    sums: NDArray[np.int32]


def _gathered(
    caster: RayCaster, shared: Shared, data: tuple[Any, ...], packets: Packets, rays: int
) -> Packets:
    """Have a kernel colour rays; those, of so many numbers, that it leaves open."""
    room = _Gathering(
        packets.order,
        packets.starts,
        np.empty(rays, np.bool_),
        np.empty(len(packets.starts) - 1, np.int32),
        np.empty(len(packets.order), np.int32),
        np.empty(len(packets.starts), np.int32),
        np.empty(2, np.int32),
    )
    caster.in_parts(shared, (data, tuple(room)), len(room.places), _PACKETS)
    count, groups = room.sums
    return Packets(room.chosen[:count], room.begins[: groups + 1])


def _towards(offsets: NDArray[np.float32]) -> NDArray[np.int32]:
    """``(K, 2)`` which way, right and down, the other three of the pixels around a place are."""
    towards: NDArray[np.int32] = np.where(offsets < 0.0, np.int32(-1), np.int32(1))
    return towards


def extra_rays(rough: Rough, samples: int) -> Packets:
    """All extra rays of the rough pixels, ``samples`` of each; which of them run side by side."""
    rays = np.arange(len(rough.pixels) * samples, dtype=np.int32)
    return Packets(rays, rough.begins * np.int32(samples))


def mixed(
    caster: RayCaster,
    frame: Frame,
    detail: NDArray[np.uint8],
    hits: Hits,
    size: tuple[int, int],
    colours: NDArray[np.float32],
    edges: NDArray[np.int32],
    offsets: NDArray[np.float32],
    packets: Packets,
    out: NDArray[np.float32],
    aim: tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]] | None = None,
) -> Packets:
    """Colour the extra rays amid pixels that show one surface; which are still to be traced.

    Args:
        caster: runs the kernels.
        frame: what was seen.
        detail: ``(M,)`` uint8 pattern of each material.
        hits: of the picture.
        size: its width and height.
        colours: ``(N, 3)`` of its pixels.
        edges: pixels that the extra rays go through, ``K`` for each.
        offsets: ``(K, 2)`` where, right and down from a pixel's centre, in pixels.
        packets: all extra rays by their numbers, those that run side by side together; from
            :func:`extra_rays`.
        out: ``(E * K, 3)`` receives their colours.
        aim: for those still to be traced: directions through the pixels' centres, how far from
            them each extra ray is, and what receives their own; see :func:`aim_again`.
    """
    towards, shares = _towards(offsets), np.abs(offsets)
    data = (
        frame.static, frame.actors, detail, hits.row, hits.triangle, *size, colours, edges,
        towards, shares, out, *(aim or [np.empty((0, 3), np.float32)] * 3),
    )  # fmt: skip
    return _gathered(caster, _mix_and_gather, data, packets, len(out))


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
        packets: those that were traced.
        out: ``(E * K, 3)`` receives their colours.
    """
    data = (
        hits.row, hits.triangle, *size, colours, edges, _towards(offsets), again.row,
        again.triangle, out,
    )  # fmt: skip
    return _gathered(caster, _lend_and_gather, data, packets, len(out))
