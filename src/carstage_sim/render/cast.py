"""The ray caster: nearest hit and any hit in a two-level hierarchy, and the batch kernel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device
from carstage_sim.render.leaves import is_gap
from carstage_sim.render.simd import box_hits, lowest_bit, triangle_hits
from carstage_sim.render.vector_code import LANES

STATIC = -1
"""Instance row of hits on static geometry."""
NOTHING = -2
"""Instance row of rays that met nothing."""

_STACK = 512


class Geometry(NamedTuple):
    """Hierarchies over triangles, one behind the other in shared arrays.

    Attributes:
        planes: ``(N, 6, 8)`` float32 child boxes.
        children: ``(N, 8)`` int32: node, or ``-1 - block``.
        corners: ``(B, 9, 8)`` float32 triangle corners of each leaf block.
        numbers: ``(B, 8)`` int32 triangle numbers.
        cells: ``(B, 8)`` uint8 of cards of leaves; see
            :func:`carstage_sim.render.materials.cells_of_materials`.
    """

    planes: NDArray[np.float32]
    children: NDArray[np.int32]
    corners: NDArray[np.float32]
    numbers: NDArray[np.int32]
    cells: NDArray[np.uint8]


class Scratch(NamedTuple):
    """Working memory of one thread; kernels allocate nothing.

    Attributes:
        stack: ``(512,)`` int32 nodes to visit.
        entries: ``(512,)`` float32 parameters at which they are entered.
        tests: ``(24,)`` float32 results of eight tests.
    """

    stack: NDArray[np.int32]
    entries: NDArray[np.float32]
    tests: NDArray[np.float32]


def new_scratch() -> Scratch:
    """Working memory for one thread."""
    return Scratch(
        np.empty(_STACK, np.int32), np.empty(_STACK, np.float32), np.empty(3 * LANES, np.float32)
    )


@device
def scratch_of(memory, worker):  # type: ignore[no-untyped-def]
    """That of one thread, of :func:`carstage_sim.render.crew.for_workers`."""
    return Scratch(memory.stack[worker], memory.entries[worker], memory.tests[worker])


class Scene(NamedTuple):
    """All that a ray can meet in one frame.

    Attributes:
        static: the town, in world coordinates, root at node 0.
        actors: the actors' meshes, each in its own frame.
        top_planes: ``(K, 6, 8)`` float32 hierarchy over the instances' world boxes; K may be 0.
        top_children: ``(K, 8)`` int32: node, or ``-1 - place``.
        top_row: ``(I,)`` int32 instance row of each place.
        rotation: ``(I, 3, 3)`` float32 world_from_actor of each row.
        position: ``(I, 3)`` float32 world metres of each row.
        root: ``(I,)`` int32 root node of each row's mesh in ``actors``.
    """

    static: Geometry
    actors: Geometry
    top_planes: NDArray[np.float32]
    top_children: NDArray[np.int32]
    top_row: NDArray[np.int32]
    rotation: NDArray[np.float32]
    position: NDArray[np.float32]
    root: NDArray[np.int32]


@device
def finite_inverse(d):  # type: ignore[no-untyped-def]
    """Reciprocal of a direction's component, finite: no ray is parallel to a plane."""
    if abs(d) < np.float32(1e-12):
        return np.float32(1e12) if d >= 0 else np.float32(-1e12)
    return np.float32(1) / d


@device
def _walk(geometry, node, o, d, low, high, ties, u, v, any_hit, stack, depth, entries, tests):  # type: ignore[no-untyped-def]
    """Nearest triangle of one hierarchy in ``[low, high]``; of equals the lowest number.

    ``ties`` says whether a hit at ``high`` itself counts. ``stack[depth:]`` is free.
    """
    ix, iy, iz = finite_inverse(d[0]), finite_inverse(d[1]), finite_inverse(d[2])
    near_x = 0 if ix >= 0 else 3
    near_y = 0 if iy >= 0 else 3
    near_z = 0 if iz >= 0 else 3
    ax, ay, az = abs(d[0]), abs(d[1]), abs(d[2])
    if ax >= ay and ax >= az:
        kx, ky, kz = 1, 2, 0
        dx, dy, dz, px, py, pz = d[1], d[2], d[0], o[1], o[2], o[0]
    elif ay >= az:
        kx, ky, kz = 2, 0, 1
        dx, dy, dz, px, py, pz = d[2], d[0], d[1], o[2], o[0], o[1]
    else:
        kx, ky, kz = 0, 1, 2
        dx, dy, dz, px, py, pz = d[0], d[1], d[2], o[0], o[1], o[2]
    sz = np.float32(1) / dz
    sx, sy = dx * sz, dy * sz
    owned = high
    number = -1
    base = depth
    stack[depth] = node
    entries[depth] = low
    depth += 1
    while depth > base:
        depth -= 1
        if entries[depth] > high:
            continue
        node = stack[depth]
        if node < 0:
            block = -1 - node
            bits = triangle_hits(
                geometry.corners, block, kx, ky, kz, px, py, pz, sx, sy, sz, low, high, tests
            )
            while bits:
                lane = lowest_bit(bits)
                bits &= bits - 1
                t = tests[lane]
                index = geometry.numbers[block, lane]
                if t < high or (
                    t == high and (index < number if number >= 0 else ties or t < owned)
                ):
                    cells = geometry.cells[block, lane]
                    if cells and is_gap(cells, index, tests[LANES + lane], tests[2 * LANES + lane]):
                        continue
                    high, number = t, index
                    u, v = tests[LANES + lane], tests[2 * LANES + lane]
                    if any_hit:
                        return high, number, u, v
            continue
        bits = box_hits(
            geometry.planes, node, near_x, near_y, near_z,
            o[0], o[1], o[2], ix, iy, iz, low, high, tests,
        )  # fmt: skip
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
    return high, number, u, v


@device
def trace_actors(scene, scratch, o, d, low, high, skip, any_hit, row, triangle, u, v):  # type: ignore[no-untyped-def]
    """Whether a ray meets an actor before what it is known to meet.

    Args:
        scene, scratch, o, d, low, skip, any_hit: as for :func:`trace`.
        high, row, triangle, u, v: what the ray is known to meet.

    Returns:
        As :func:`trace`.
    """
    stack, entries, tests = scratch.stack, scratch.entries, scratch.tests
    if not scene.top_planes.shape[0]:
        return high, row, triangle, u, v
    ix, iy, iz = finite_inverse(d[0]), finite_inverse(d[1]), finite_inverse(d[2])
    near_x = 0 if ix >= 0 else 3
    near_y = 0 if iy >= 0 else 3
    near_z = 0 if iz >= 0 else 3
    stack[0] = 0
    entries[0] = low
    depth = 1
    while depth:
        depth -= 1
        if entries[depth] > high:
            continue
        node = stack[depth]
        if node < 0:
            other = scene.top_row[-1 - node]
            if other == skip:
                continue
            r = scene.rotation[other]
            x = o[0] - scene.position[other, 0]
            y = o[1] - scene.position[other, 1]
            z = o[2] - scene.position[other, 2]
            local_o = (
                r[0, 0] * x + r[1, 0] * y + r[2, 0] * z,
                r[0, 1] * x + r[1, 1] * y + r[2, 1] * z,
                r[0, 2] * x + r[1, 2] * y + r[2, 2] * z,
            )
            local_d = (
                r[0, 0] * d[0] + r[1, 0] * d[1] + r[2, 0] * d[2],
                r[0, 1] * d[0] + r[1, 1] * d[1] + r[2, 1] * d[2],
                r[0, 2] * d[0] + r[1, 2] * d[1] + r[2, 2] * d[2],
            )
            t, index, a, b = _walk(
                scene.actors, scene.root[other], local_o, local_d, low, high, other < row,
                u, v, any_hit,
                stack, depth, entries, tests,
            )  # fmt: skip
            if index >= 0:
                high, row, triangle, u, v = t, other, index, a, b
                if any_hit:
                    return high, row, triangle, u, v
            continue
        bits = box_hits(
            scene.top_planes, node, near_x, near_y, near_z,
            o[0], o[1], o[2], ix, iy, iz, low, high, tests,
        )  # fmt: skip
        first = depth
        while bits:
            lane = lowest_bit(bits)
            bits &= bits - 1
            t = tests[lane]
            child = scene.top_children[node, lane]
            place = depth
            while place > first and entries[place - 1] < t:
                entries[place] = entries[place - 1]
                stack[place] = stack[place - 1]
                place -= 1
            entries[place] = t
            stack[place] = child
            depth += 1
    return high, row, triangle, u, v


@device
def trace(scene, scratch, o, d, low, high, skip, any_hit):  # type: ignore[no-untyped-def]
    """What a ray meets first: parameter, instance row, triangle, weights of corners 0 and 1.

    Args:
        scene: what can be met.
        scratch: a :class:`Scratch` of this thread.
        o: origin, three float32.
        d: direction, three float32, not all zero; the parameter counts in its length.
        low, high: interval of the parameter.
        skip: instance row that is not met, or a negative number.
        any_hit: end at the first triangle found, whichever.

    Returns:
        ``(t, row, triangle, u, v)``; row is ``STATIC`` or ``NOTHING`` where no instance was met.
        Of hits at the same parameter the static one wins, then the lowest row, then the lowest
        triangle number.
    """
    stack, entries, tests = scratch.stack, scratch.entries, scratch.tests
    row, triangle = NOTHING, -1
    u, v = np.float32(0), np.float32(0)
    if scene.static.planes.shape[0]:
        high, triangle, u, v = _walk(
            scene.static, 0, o, d, low, high, False, u, v, any_hit, stack, 0, entries, tests
        )
        if triangle >= 0:
            row = STATIC
            if any_hit:
                return high, row, triangle, u, v
    return trace_actors(scene, scratch, o, d, low, high, skip, any_hit, row, triangle, u, v)


@device
def cast_rays(  # type: ignore[no-untyped-def]
    scene, scratch, origins, directions, low, high, skip, first, last, t, row, triangle, weights
):
    """Nearest hits of the rays ``first`` to ``last``; writes into the last four.

    Args:
        scene: a :class:`Scene`.
        scratch: a :class:`Scratch` of this thread.
        origins: ``(1, 3)`` float32 for all rays, or ``(N, 3)`` for each its own.
        directions: ``(N, 3)`` float32, any length.
        low, high: float32 interval of the ray parameter.
        skip: instance row that is not met, or a negative number.
        first, last: half-open range of rays.
        t: ``(N,)`` float32 parameter; ``high`` where nothing is met.
        row: ``(N,)`` int32 instance row, ``STATIC`` or ``NOTHING``.
        triangle: ``(N,)`` int32 triangle number, -1 where nothing is met.
        weights: ``(N, 2)`` float32 barycentric weights of the first and second corner.
    """
    shared = origins.shape[0] == 1
    for i in range(first, last):
        j = 0 if shared else i
        o = (origins[j, 0], origins[j, 1], origins[j, 2])
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        hit = trace(scene, scratch, o, d, low, high, skip, False)
        t[i], row[i], triangle[i] = hit[0], hit[1], hit[2]
        weights[i, 0], weights[i, 1] = hit[3], hit[4]


def empty_geometry() -> Geometry:
    """A geometry without triangles."""
    return Geometry(
        np.empty((0, 6, LANES), np.float32),
        np.empty((0, LANES), np.int32),
        np.empty((0, 9, LANES), np.float32),
        np.empty((0, LANES), np.int32),
        np.empty((0, LANES), np.uint8),
    )
