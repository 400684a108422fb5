"""Rays of one origin that run side by side, traced together.

A packet has up to 64 rays. The bounds of their directions tell at once which boxes and triangles
none of them meets; a triangle is then tested against those rows of eight rays that it may cover.
Each ray meets exactly what :func:`carstage_sim.render.cast.trace` finds for it: the tests of a ray
with a triangle are the same operations, and what is left out is only what a ray cannot meet.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device
from carstage_sim.render.beam_simd import (
    boxes_in_beam,
    boxes_in_slabs,
    enclose_rays,
    rays_hit,
    rows_in_beam,
    shear_rays,
    triangles_in_beam,
)
from carstage_sim.render.cast import (
    NOTHING,
    STATIC,
    Scratch,
    new_scratch,
    scratch_of,
    trace,
    trace_actors,
)
from carstage_sim.render.leaf_lanes import on_leaves
from carstage_sim.render.packet_simd import PACKET, largest
from carstage_sim.render.simd import lowest_bit
from carstage_sim.render.vector_code import LANES

TOGETHER = 4 * PACKET
"""Rays of which some that run side by side are chosen."""
_ROWS = PACKET // LANES
_ONE: Any = np.float32(1)
_LEAST_AHEAD: Any = np.float32(0.25)
"""Square of the cosine with a packet's middle direction from which a ray strays too far."""
_LEAST_COMPONENT: Any = np.float32(1e-6)
"""Rays agree on the sign of a component if it is larger."""
_SLACK: Any = np.float32(1e-6)
_FARTHEST = 3
"""Row of ``rays`` after the three of the shear."""
_ROW_FARTHEST = 2
"""Row of ``slopes`` after the least and the largest."""
_MIDDLE, _REACH, _INVERSE, _BOUNDS = 15, 18, 19, 9
"""Places in ``beam`` and ``axes``."""


class PacketScratch(NamedTuple):
    """Working memory of one thread.

    Attributes:
        single: of rays that are traced alone.
        ways: ``(3, 64)`` float32 the rays' directions, x, y, z.
        rays: ``(4, 64)`` float32; see :func:`carstage_sim.render.beam_simd.rays_hit`.
        weights: ``(2, 64)`` float32 of what they met.
        triangle: ``(64,)`` int32 what they met, -1 for nothing.
        beam: ``(28,)`` float32; see ``boxes_in_beam``, ``boxes_in_slabs`` and ``boxes_in_shaft``.
        axes: ``(13,)`` float32; see :func:`carstage_sim.render.beam_simd.triangles_in_beam`.
        slopes: ``(5, 8)`` float32 of each row of eight rays; see
            :func:`carstage_sim.render.beam_simd.rows_in_beam` and ``rows_in_shaft``.
        places: ``(32,)`` float32 slopes of eight triangles.
        found: ``(3, 64)`` float32 where the rays meet a triangle, and its weights there.
        starts: ``(3, 64)`` float32 origins of parallel rays.
        from_: ``(4, 256)`` float32 places that parallel rays are wanted from, and how far from the
            camera each is, about.
        wanted: ``(1,)`` int32 how many of them.
        met: ``(256,)`` float32 how far what they met is, negative for nothing.
        open: ``(256,)`` int32 places not traced yet.
        group: ``(64,)`` int32 those being traced.
    """

    single: Scratch
    ways: NDArray[np.float32]
    rays: NDArray[np.float32]
    weights: NDArray[np.float32]
    triangle: NDArray[np.int32]
    beam: NDArray[np.float32]
    axes: NDArray[np.float32]
    slopes: NDArray[np.float32]
    places: NDArray[np.float32]
    found: NDArray[np.float32]
    starts: NDArray[np.float32]
    from_: NDArray[np.float32]
    wanted: NDArray[np.int32]
    met: NDArray[np.float32]
    open: NDArray[np.int32]
    group: NDArray[np.int32]


def new_packet_scratch() -> PacketScratch:
    """Working memory for one thread."""
    return PacketScratch(
        new_scratch(),
        np.empty((3, PACKET), np.float32),
        np.empty((4, PACKET), np.float32),
        np.empty((2, PACKET), np.float32),
        np.empty(PACKET, np.int32),
        np.empty(28, np.float32),
        np.empty(13, np.float32),
        np.empty((5, _ROWS), np.float32),
        np.empty(4 * LANES, np.float32),
        np.empty((3, PACKET), np.float32),
        np.empty((3, PACKET), np.float32),
        np.empty((4, TOGETHER), np.float32),
        np.zeros(1, np.int32),
        np.empty(TOGETHER, np.float32),
        np.empty(TOGETHER, np.int32),
        np.empty(PACKET, np.int32),
    )


@device
def packet_scratch_of(memory, worker):  # type: ignore[no-untyped-def]
    """That of one thread, of :func:`carstage_sim.render.crew.for_workers`."""
    return PacketScratch(
        scratch_of(memory.single, worker), memory.ways[worker], memory.rays[worker],
        memory.weights[worker], memory.triangle[worker], memory.beam[worker], memory.axes[worker],
        memory.slopes[worker], memory.places[worker], memory.found[worker], memory.starts[worker],
        memory.from_[worker], memory.wanted[worker], memory.met[worker], memory.open[worker],
        memory.group[worker],
    )  # fmt: skip


@device
def _slabs(numbers, beam):  # type: ignore[no-untyped-def]
    """Fill in the bounds of the reciprocals of the rays' components; see :func:`_aim`.

    ``numbers``: as :func:`carstage_sim.render.beam_simd.shear_rays` leaves them.
    """
    for axis in range(3):
        least, most = numbers[3 + 2 * axis], numbers[4 + 2 * axis]
        if not (least > _LEAST_COMPONENT or most < -_LEAST_COMPONENT):
            return -1, -1, -1
        beam[_INVERSE + 2 * axis], beam[_INVERSE + 2 * axis + 1] = _ONE / most, _ONE / least
    return (
        0 if numbers[3] > 0 else 3,
        0 if numbers[5] > 0 else 3,
        0 if numbers[7] > 0 else 3,
    )


@device
def _aim(memory, count):  # type: ignore[no-untyped-def]
    """Put planes around whole rows of rays; whether they run side by side.

    Also fills what its triangle tests need.

    Returns:
        Which axis they look along, 0 to 2, or -1 where the rays have to be traced one by one; for
        each axis, 0 where they run upwards along it and 3 where downwards, or first -1 where they
        do not agree.
    """
    ways, beam, axes, slopes = memory.ways, memory.beam, memory.axes, memory.slopes
    numbers, groups = memory.places, count // LANES
    ax, ay, az = abs(ways[0, 0]), abs(ways[1, 0]), abs(ways[2, 0])
    main = 0 if ax >= ay and ax >= az else (1 if ay >= az else 2)
    if not shear_rays(ways, groups, main, memory.rays, numbers):
        return -1, -1, -1, -1
    sides = _slabs(numbers, beam)
    x, y, z = numbers[0], numbers[1], numbers[2]
    length = math.sqrt(x * x + y * y + z * z)
    if not length > np.float32(0):
        return -1, -1, -1, -1
    x, y, z = x / length, y / length, z / length
    # Two directions across the middle one (Duff et al., JCGT 2017); rows of rays differ along the
    # second, which is the more upright one.
    sign = _ONE if z >= 0 else -_ONE
    a = -_ONE / (sign + z)
    b = x * y * a
    ux, uy, uz = _ONE + sign * x * x * a, sign * b, -sign * x
    vx, vy, vz = b, sign + y * y * a, -y
    if abs(z) < np.float32(0.8):
        flat = math.sqrt(x * x + y * y)
        ux, uy, uz = -y / flat, x / flat, np.float32(0)
        vx, vy, vz = -z * uy, z * ux, x * uy - y * ux
    axes[0], axes[1], axes[2] = ux, uy, uz
    axes[3], axes[4], axes[5] = vx, vy, vz
    axes[6], axes[7], axes[8] = x, y, z
    if not enclose_rays(ways, groups, axes, _LEAST_AHEAD, slopes, numbers):
        return -1, -1, -1, -1
    for g in range(groups):
        slopes[0, g], slopes[1, g] = slopes[0, g] - _SLACK, slopes[1, g] + _SLACK
    least_u, most_u, least_v, most_v = numbers[0], numbers[1], numbers[2], numbers[3]
    reach = numbers[4]
    least_u, most_u = least_u - _SLACK, most_u + _SLACK
    least_v, most_v = least_v - _SLACK, most_v + _SLACK
    beam[3], beam[4], beam[5] = ux - least_u * x, uy - least_u * y, uz - least_u * z
    beam[6], beam[7], beam[8] = most_u * x - ux, most_u * y - uy, most_u * z - uz
    beam[9], beam[10], beam[11] = vx - least_v * x, vy - least_v * y, vz - least_v * z
    beam[12], beam[13], beam[14] = most_v * x - vx, most_v * y - vy, most_v * z - vz
    beam[_MIDDLE], beam[_MIDDLE + 1], beam[_MIDDLE + 2] = x, y, z
    beam[_REACH] = _ONE / (reach * (_ONE + _SLACK))
    axes[_BOUNDS], axes[_BOUNDS + 1] = least_u, most_u
    axes[_BOUNDS + 2], axes[_BOUNDS + 3] = least_v, most_v
    return main, sides[0], sides[1], sides[2]


@device
def _leaf(geometry, memory, block, main, low, farthest):  # type: ignore[no-untyped-def]
    """Let a packet's rays meet the triangles of a leaf; the largest parameter that counts then."""
    rays, found, slopes, places = memory.rays, memory.found, memory.slopes, memory.places
    kx, ky, kz = (main + 1) % 3, (main + 2) % 3, main
    near = triangles_in_beam(geometry.corners, block, memory.axes, memory.beam, farthest, places)
    changed = 0
    while near:
        lane = lowest_bit(near)
        near &= near - 1
        index = geometry.numbers[block, lane]
        if index < 0:
            break
        rows = rows_in_beam(slopes, places, lane)
        bits = rays_hit(
            geometry.corners, block, lane, kx, ky, kz, memory.beam, rays, rows, low, found
        )
        cells = geometry.cells[block, lane]
        if cells and bits:
            bits = on_leaves(bits, found, cells, index)
        while bits:
            i = lowest_bit(bits)
            bits &= bits - 1
            t = found[0, i]
            known = memory.triangle[i]
            # At the very end of the interval nothing counts that came after it.
            if t < rays[_FARTHEST, i] or (0 <= index < known):
                rays[_FARTHEST, i] = t
                memory.triangle[i] = index
                memory.weights[0, i] = found[1, i]
                memory.weights[1, i] = found[2, i]
                changed |= 1 << (i // LANES)
    if not changed:
        return farthest
    while changed:
        g = lowest_bit(changed)
        changed &= changed - 1
        slopes[_ROW_FARTHEST, g] = largest(rays, _FARTHEST * _ROWS + g, 1)
    return largest(slopes, _ROW_FARTHEST, 1)


@device
def _boxes(planes, node, memory, sides, low, farthest):  # type: ignore[no-untyped-def]
    """Which of a node's eight boxes a packet may meet; ``sides``: see :func:`_aim`."""
    tests = memory.single.tests
    if sides[0] < 0:
        return boxes_in_beam(planes, node, memory.beam, farthest, tests)
    return boxes_in_slabs(
        planes, node, sides[0], sides[1], sides[2], memory.beam, low, farthest, tests
    )


@device
def _walk_together(geometry, memory, main, sides, low, count, farthest):  # type: ignore[no-untyped-def]
    """Nearest triangles of one hierarchy for all rays of a packet."""
    stack, entries, tests = memory.single.stack, memory.single.entries, memory.single.tests
    for g in range(_ROWS):
        memory.slopes[_ROW_FARTHEST, g] = farthest if g * LANES < count else np.float32(-np.inf)
    stack[0] = 0
    entries[0] = low
    depth = 1
    while depth:
        depth -= 1
        if entries[depth] > farthest:
            continue
        node = stack[depth]
        if node < 0:
            farthest = _leaf(geometry, memory, -1 - node, main, low, farthest)
            continue
        bits = _boxes(geometry.planes, node, memory, sides, low, farthest)
        first = depth
        while bits:
            lane = lowest_bit(bits)
            bits &= bits - 1
            t = tests[lane]
            child = geometry.children[node, lane]
            # Nearest child on top of the stack.
            place = depth
            while place > first and entries[place - 1] < t:
                entries[place] = entries[place - 1]
                stack[place] = stack[place - 1]
                place -= 1
            entries[place] = t
            stack[place] = child
            depth += 1
    return farthest


@device
def _meets_instances(scene, memory, sides, low, farthest, skip):  # type: ignore[no-untyped-def]
    """Whether a packet may meet the box of any instance."""
    stack = memory.single.stack
    if not scene.top_planes.shape[0]:
        return False
    stack[0] = 0
    depth = 1
    while depth:
        depth -= 1
        node = stack[depth]
        if node < 0:
            if scene.top_row[-1 - node] != skip:
                return True
            continue
        bits = _boxes(scene.top_planes, node, memory, sides, low, farthest)
        while bits:
            lane = lowest_bit(bits)
            bits &= bits - 1
            stack[depth] = scene.top_children[node, lane]
            depth += 1
    return False


@device
def cast_packets(  # type: ignore[no-untyped-def]
    scene, memory, origin, directions, order, starts, low, high, skip, first, last,
    t, row, triangle, weights,
):  # fmt: skip
    """Nearest hits of the packets ``first`` to ``last``; writes into the last four.

    Args:
        scene: a :class:`carstage_sim.render.cast.Scene`.
        memory: a :class:`PacketScratch` of this thread.
        origin: ``(3,)`` float32 of all rays.
        directions: ``(N, 3)`` float32, any length.
        order: ``(N,)`` int32 numbers of the rays, packet after packet.
        starts: ``(P + 1,)`` int32 where in ``order`` each packet begins, at most 64 apart.
        low, high, skip, t, row, triangle, weights: as for
            :func:`carstage_sim.render.cast.cast_rays`.
        first, last: half-open range of packets.
    """
    o = (origin[0], origin[1], origin[2])
    memory.beam[0], memory.beam[1], memory.beam[2] = o[0], o[1], o[2]
    for packet in range(first, last):
        begin = starts[packet]
        count = starts[packet + 1] - begin
        groups = (count + LANES - 1) // LANES
        for i in range(groups * LANES):
            ray = order[begin + min(i, count - 1)]
            for axis in range(3):
                memory.ways[axis, i] = directions[ray, axis]
            memory.rays[_FARTHEST, i] = high
            memory.triangle[i] = -1
            memory.weights[0, i] = np.float32(0)
            memory.weights[1, i] = np.float32(0)
        main, near_x, near_y, near_z = _aim(memory, groups * LANES)
        sides = (near_x, near_y, near_z)
        if main < 0:
            for i in range(count):
                ray = order[begin + i]
                d = (memory.ways[0, i], memory.ways[1, i], memory.ways[2, i])
                hit = trace(scene, memory.single, o, d, low, high, skip, False)
                t[ray], row[ray], triangle[ray] = hit[0], hit[1], hit[2]
                weights[ray, 0], weights[ray, 1] = hit[3], hit[4]
            continue
        farthest = high
        if scene.static.planes.shape[0]:
            farthest = _walk_together(scene.static, memory, main, sides, low, groups * LANES, high)
        crowded = _meets_instances(scene, memory, sides, low, farthest, skip)
        for i in range(count):
            ray = order[begin + i]
            met = memory.triangle[i]
            hit = (
                memory.rays[_FARTHEST, i], STATIC if met >= 0 else NOTHING, met,
                memory.weights[0, i], memory.weights[1, i],
            )  # fmt: skip
            if crowded:
                d = (memory.ways[0, i], memory.ways[1, i], memory.ways[2, i])
                hit = trace_actors(
                    scene, memory.single, o, d, low, hit[0], skip, False,
                    hit[1], hit[2], hit[3], hit[4],
                )  # fmt: skip
            t[ray], row[ray], triangle[ray] = hit[0], hit[1], hit[2]
            weights[ray, 0], weights[ray, 1] = hit[3], hit[4]
