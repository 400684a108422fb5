"""Parallel rays from places near each other, traced together: what stands in the sun's way.

Like :mod:`carstage_sim.render.packets`, for rays of one direction and many origins. Rays are first
sorted into groups whose origins are near each other, as a shaft around all of them must be narrow.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from carstage_sim.kernels import device
from carstage_sim.render.cast import NOTHING, finite_inverse, trace_actors
from carstage_sim.render.leaf_lanes import on_leaves
from carstage_sim.render.packet_simd import PACKET, largest
from carstage_sim.render.shaft_simd import (
    boxes_in_shaft,
    enclose_starts,
    parallel_rays_hit,
    rows_in_shaft,
    triangles_in_shaft,
)
from carstage_sim.render.simd import lowest_bit
from carstage_sim.render.vector_code import LANES

_ONE: Any = np.float32(1)
_SLACK_M: Any = np.float32(2e-5)
_NEAR_M: Any = np.float32(2.0)
_NEAR_PER_M: Any = np.float32(0.04)
"""Origins of a group are so near to the first one, and farther by the distance of the camera."""
_AWAY = 3
"""Row of ``from_`` after the three of the place."""
_FARTHEST = 3
"""Row of ``rays``."""
_ROW_FARTHEST = 4
"""Row of ``slopes``."""
_ROWS = PACKET // LANES
_AROUND = 18
"""Place in ``beam`` of how far the origins are from the first one, at most."""
_INVERSE, _FIRST, _LAST = 19, 22, 25
"""Places in ``beam``; see :func:`carstage_sim.render.shaft_simd.boxes_in_shaft`."""
_BLOCKED: Any = np.float32(-1)


@device
def _leaf(geometry, memory, block, way, low, any_hit):  # type: ignore[no-untyped-def]
    """Let the rays meet the triangles of a leaf; how many of them were blocked for good."""
    rays, found, places = memory.rays, memory.found, memory.places
    kx, ky, kz, sx, sy, sz = way
    near = triangles_in_shaft(geometry.corners, block, memory.beam, places)
    blocked, changed = 0, 0
    while near:
        lane = lowest_bit(near)
        near &= near - 1
        index = geometry.numbers[block, lane]
        if index < 0:
            break
        rows = rows_in_shaft(memory.slopes, places, lane)
        bits = parallel_rays_hit(
            geometry.corners, block, lane, kx, ky, kz, memory.starts, sx, sy, sz, rays, rows,
            low, found,
        )  # fmt: skip
        cells = geometry.cells[block, lane]
        if cells and bits:
            bits = on_leaves(bits, found, cells, index)
        while bits:
            i = lowest_bit(bits)
            bits &= bits - 1
            memory.triangle[i] = index
            if any_hit:
                rays[_FARTHEST, i] = _BLOCKED
                blocked += 1
                changed |= 1 << (i // LANES)
            else:
                rays[_FARTHEST, i] = found[0, i]
    while changed:
        g = lowest_bit(changed)
        changed &= changed - 1
        memory.slopes[_ROW_FARTHEST, g] = largest(rays, _FARTHEST * _ROWS + g, 1)
    return blocked


@device
def _walk_along(geometry, memory, way, nears, low, high, count, any_hit):  # type: ignore[no-untyped-def]
    """What the rays of a group meet in one hierarchy."""
    stack, entries, tests = memory.single.stack, memory.single.entries, memory.single.tests
    left = count
    for g in range(_ROWS):
        memory.slopes[_ROW_FARTHEST, g] = _ONE if g * LANES < count else _BLOCKED
    stack[0] = 0
    depth = 1
    while depth:
        depth -= 1
        node = stack[depth]
        if node < 0:
            left -= _leaf(geometry, memory, -1 - node, way, low, any_hit)
            if left == 0:
                return
            continue
        bits = boxes_in_shaft(
            geometry.planes, node, nears[0], nears[1], nears[2], memory.beam, low, high, tests
        )
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


@device
def _meets_instances(scene, memory, nears, low, high, skip):  # type: ignore[no-untyped-def]
    """Whether a group may meet the box of any instance."""
    stack, tests = memory.single.stack, memory.single.tests
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
        bits = boxes_in_shaft(
            scene.top_planes, node, nears[0], nears[1], nears[2], memory.beam, low, high, tests
        )
        while bits:
            lane = lowest_bit(bits)
            bits &= bits - 1
            stack[depth] = scene.top_children[node, lane]
            depth += 1
    return False


@device
def _enclose(memory, d, high, count):  # type: ignore[no-untyped-def]
    """Put a shaft around the rays ``d`` from ``memory.starts``; axes and shear of their tests."""
    beam, starts, slopes = memory.beam, memory.starts, memory.slopes
    x, y, z = d
    sign = _ONE if z >= 0 else -_ONE
    a = -_ONE / (sign + z)
    b = x * y * a
    ux, uy, uz = _ONE + sign * x * x * a, sign * b, -sign * x
    vx, vy, vz = b, sign + y * y * a, -y
    ox, oy, oz = starts[0, 0], starts[1, 0], starts[2, 0]
    beam[0], beam[1], beam[2] = ox, oy, oz
    beam[3], beam[4], beam[5] = ux, uy, uz
    beam[6], beam[7], beam[8] = vx, vy, vz
    beam[9], beam[10], beam[11] = x, y, z
    enclose_starts(starts, (count + LANES - 1) // LANES, beam, _SLACK_M, slopes)
    beam[_AROUND] = np.float32(0)
    for k in range(12, 18, 2):
        beam[_AROUND] += max(-beam[k], beam[k + 1])
    beam[16] -= _SLACK_M
    beam[17] += high * (_ONE + np.float32(1e-5)) + _SLACK_M
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        sz = _ONE / x
        return 1, 2, 0, y * sz, z * sz, sz
    if ay >= az:
        sz = _ONE / y
        return 2, 0, 1, z * sz, x * sz, sz
    sz = _ONE / z
    return 0, 1, 2, x * sz, y * sz, sz


@device
def _slabs(beam, d):  # type: ignore[no-untyped-def]
    """Fill in what tests of boxes need; 0 for axes along which the rays run upwards, else 3.

    The origins' least and largest coordinates are where :func:`enclose_starts` left them.
    """
    for axis in range(3):
        inverse = finite_inverse(d[axis])
        beam[_INVERSE + axis] = inverse
        if inverse >= 0:
            least = beam[_FIRST + axis]
            beam[_FIRST + axis] = beam[_LAST + axis]
            beam[_LAST + axis] = least
    return (
        0 if beam[_INVERSE] >= 0 else 3,
        0 if beam[_INVERSE + 1] >= 0 else 3,
        0 if beam[_INVERSE + 2] >= 0 else 3,
    )


@device
def _trace_group(scene, memory, d, low, high, skip, any_hit, count):  # type: ignore[no-untyped-def]
    """Whether each of ``memory.starts`` meets anything: then ``memory.triangle`` is not -1.

    ``memory.rays`` has where, unless ``any_hit``.
    """
    groups = (count + LANES - 1) // LANES
    for i in range(groups * LANES):
        memory.rays[_FARTHEST, i] = high if i < count else _BLOCKED
        memory.triangle[i] = -1
        if i >= count:
            for axis in range(3):
                memory.starts[axis, i] = memory.starts[axis, 0]
    way = _enclose(memory, d, high, count)
    nears = _slabs(memory.beam, d)
    if scene.static.planes.shape[0]:
        _walk_along(scene.static, memory, way, nears, low, high, count, any_hit)
    if any_hit and largest(memory.rays, _FARTHEST * _ROWS, groups) < np.float32(0):
        return
    if _meets_instances(scene, memory, nears, low, high, skip):
        for i in range(count):
            limit = memory.rays[_FARTHEST, i]
            if limit < np.float32(0):
                continue
            o = (memory.starts[0, i], memory.starts[1, i], memory.starts[2, i])
            hit = trace_actors(
                scene, memory.single, o, d, low, limit, skip, any_hit,
                NOTHING, -1, np.float32(0), np.float32(0),
            )  # fmt: skip
            if hit[1] != NOTHING:
                memory.triangle[i] = hit[2]
                memory.rays[_FARTHEST, i] = hit[0]


@device
def trace_along(scene, memory, d, low, high, skip, any_hit):  # type: ignore[no-untyped-def]
    """Trace rays of one direction from the first ``memory.wanted[0]`` places of ``memory.from_``.

    Args:
        scene: what can be met.
        memory: a :class:`carstage_sim.render.packets.PacketScratch`.
        d: unit direction of all.
        low, high: interval of the ray parameter.
        skip: instance row that is not met, or a negative number.
        any_hit: whatever a ray meets is enough, however far away.

    Returns:
        nothing; ``memory.met`` has the distance of what each ray meets, or a negative number. With
        ``any_hit`` the distance is 0.
    """
    count = memory.wanted[0]
    for i in range(count):
        memory.open[i] = i
    left = count
    while left:
        first = memory.open[0]
        x, y, z = memory.from_[0, first], memory.from_[1, first], memory.from_[2, first]
        reach = _NEAR_M + memory.from_[_AWAY, first] * _NEAR_PER_M
        held, kept = 0, 0
        for k in range(left):
            i = memory.open[k]
            if (
                held < PACKET
                and abs(memory.from_[0, i] - x) <= reach
                and abs(memory.from_[1, i] - y) <= reach
                and abs(memory.from_[2, i] - z) <= reach
            ):
                for axis in range(3):
                    memory.starts[axis, held] = memory.from_[axis, i]
                memory.group[held] = i
                held += 1
            else:
                memory.open[kept] = i
                kept += 1
        left = kept
        _trace_group(scene, memory, d, low, high, skip, any_hit, held)
        for k in range(held):
            i = memory.group[k]
            memory.met[i] = _BLOCKED
            if memory.triangle[k] >= 0:
                memory.met[i] = np.float32(0) if any_hit else memory.rays[_FARTHEST, k]
