"""Tests of a packet's rays with boxes and triangles, written as LLVM vector code.

Rays of a packet begin at one place (a beam) or run in one direction (a shaft). Boxes and triangles
that none of them meets are told eight at a time; a triangle is then tested with eight rays at once,
by the operations of :mod:`carstage_sim.render.simd`. Beams and shafts stand in one module, as
most of what their tests are made of is common to both.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from carstage_sim.kernels import Decorator
from carstage_sim.render.simd import meet_triangles
from carstage_sim.render.vector_code import (
    I32,
    I64,
    LANES,
    REALS,
    bits_of,
    constant,
    larger_of,
    load_lanes,
    new_variable,
    smaller_of,
    splat,
    store_lanes,
    unpack,
)

PACKET = 64
"""Rays that are traced together."""
_BEAM_SLACK = 3e-6
"""Share of a box's largest coordinates that allows for rounding: normals of a beam's sides have
components below 2.8."""
_EDGES = ((0, 1), (1, 2), (2, 0))
_EDGE_SLACK = 1e-5
"""Share of two corners' distances, multiplied, that allows for the rounding of an edge's side."""

_intrinsic: Decorator = intrinsic


def _in_rows(builder: Any, rows: Any, meet_row: Callable[[Any], Any]) -> Any:
    """``meet_row`` of each row of eight rays whose bit is set; their bits one behind the other."""
    nothing, one = ir.Constant(I64, 0), ir.Constant(I64, 1)
    left, met = new_variable(builder, rows), new_variable(builder, nothing)
    check, body, end = (builder.append_basic_block(name) for name in ("check", "row", "rows_end"))
    builder.branch(check)
    builder.position_at_end(check)
    value = builder.load(left)
    builder.cbranch(builder.icmp_unsigned("!=", value, nothing), body, end)
    builder.position_at_end(body)
    row = builder.cttz(value, cgutils.true_bit)
    builder.store(builder.and_(value, builder.sub(value, one)), left)
    bits = builder.shl(meet_row(row), builder.mul(row, ir.Constant(I64, LANES)))
    builder.store(builder.or_(builder.load(met), bits), met)
    builder.branch(check)
    builder.position_at_end(end)
    return builder.load(met)


def _rows_of_found(builder: Any, row: Any) -> list[Any]:
    """Where parameters and weights of eight of 64 rays belong."""
    return [builder.add(row, ir.Constant(I64, k * PACKET // LANES)) for k in range(3)]


def _magnitude(builder: Any, value: Any) -> Any:
    kind = ir.VectorType(I32, LANES)
    mask = ir.Constant(kind, [0x7FFFFFFF] * LANES)
    return builder.bitcast(builder.and_(builder.bitcast(value, kind), mask), REALS)


def _dot(builder: Any, vector: Any, point: Any) -> Any:
    """Product of a direction, eight times the same, and eight points."""
    x, y, z = (builder.fmul(a, b) for a, b in zip(vector, point, strict=True))
    return builder.fadd(builder.fadd(x, y), z)


def _reach(builder: Any, low: list[Any], high: list[Any]) -> Any:
    """Sum of the largest coordinates of eight boxes' corners."""
    total = None
    for one, other in zip(low, high, strict=True):
        part = larger_of(builder, _magnitude(builder, one), _magnitude(builder, other))
        total = part if total is None else builder.fadd(total, part)
    return total


def _span(builder: Any, normal: list[Any], low: list[Any], high: list[Any]) -> tuple[Any, Any]:
    """Least and largest place of eight boxes along a direction."""
    least, most = None, None
    for factor, one, other in zip(normal, low, high, strict=True):
        a, b = builder.fmul(factor, one), builder.fmul(factor, other)
        lower, upper = smaller_of(builder, a, b), larger_of(builder, a, b)
        least = lower if least is None else builder.fadd(least, lower)
        most = upper if most is None else builder.fadd(most, upper)
    return least, most


def _corner(builder: Any, data: Any, first: Any, axis: Any, corner: int) -> Any:
    """A coordinate of a triangle's corner; ``first`` is where the triangle's lane begins."""
    row = builder.add(axis, ir.Constant(I64, 3 * corner))
    place = builder.add(first, builder.mul(row, ir.Constant(I64, LANES)))
    return builder.load(builder.gep(data, [place]))


@_intrinsic
def boxes_in_beam(typing_context, planes, node, beam, farthest, entry):  # type: ignore[no-untyped-def]
    """Which of a node's eight boxes a beam of rays may meet.

    Args:
        typing_context: numba's.
        planes: as for :func:`box_hits`.
        node: row of ``planes``.
        beam: ``(>= 19,)`` float32: the rays' common origin, the normals of the four sides that
            enclose them, their middle direction, and the reciprocal of the largest component
            along it that a ray's direction has.
        farthest: ray parameter beyond which no hit is wanted.
        entry: ``(>= 8,)`` float32, receives a parameter before which no ray enters each box.

    Returns:
        int64 whose bit ``k`` says that box ``k`` may be met, with room for rounding.
    """
    signature = types.int64(planes, node, beam, farthest, entry)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, row, sides, far, out = unpack(context, builder, signature, args)

        def number(place: int) -> Any:
            index = ir.Constant(I64, place)
            return builder.load(builder.gep(sides, [index]))

        first = builder.mul(row, ir.Constant(I64, 6))
        origin = [splat(builder, number(axis)) for axis in range(3)]
        lowest, highest = (
            [
                builder.fsub(
                    load_lanes(builder, data, builder.add(first, ir.Constant(I64, axis + begin))),
                    origin[axis],
                )
                for axis in range(3)
            ]
            for begin in (0, 3)
        )
        slack = builder.fmul(_reach(builder, lowest, highest), constant(_BEAM_SLACK))
        least_off = builder.fsub(constant(0.0), slack)
        met = builder.fcmp_ordered("<=", lowest[0], highest[0])
        for side in range(5):
            normal = [splat(builder, number(3 + 3 * side + axis)) for axis in range(3)]
            least, most = _span(builder, normal, lowest, highest)
            met = builder.and_(met, builder.fcmp_ordered(">=", most, least_off))
        enters = builder.fmul(builder.fsub(least, slack), splat(builder, number(18)))
        enters = larger_of(builder, enters, constant(0.0))
        met = builder.and_(met, builder.fcmp_ordered("<=", enters, splat(builder, far)))
        store_lanes(builder, enters, out, 0)
        return bits_of(builder, met)

    return signature, codegen


def _straddled(builder: Any, points: list[Any], sizes: list[Any], bounds: list[Any]) -> Any:
    """Whether no edge of eight triangles keeps all of a beam on its outer side.

    Args:
        builder: LLVM's.
        points: the three corners, seen from the beam's origin: across it and ahead.
        sizes: how far they are, about.
        bounds: least and largest slopes of the beam's rays.
    """
    edges: list[tuple[Any, Any, Any]] = []
    for one, other in _EDGES:
        (ax, ay, az), (bx, by, bz) = points[one], points[other]
        normal = [_minor(builder, ay, bz, az, by), _minor(builder, az, bx, ax, bz)]
        slack = builder.fmul(builder.fmul(sizes[one], sizes[other]), constant(_EDGE_SLACK))
        edges.append((normal, _minor(builder, ax, by, ay, bx), slack))
    return _reaches_inside(builder, edges, bounds)


def _straddled_along(builder: Any, points: list[Any], sizes: list[Any], bounds: list[Any]) -> Any:
    """As :func:`_straddled`, of parallel rays.

    Args:
        builder: LLVM's.
        points: the three corners: across the rays.
        sizes: how far they are from the rays' origins at most.
        bounds: least and largest places of the rays.
    """
    edges: list[tuple[Any, Any, Any]] = []
    for one, other in _EDGES:
        (ax, ay), (bx, by) = points[one], points[other]
        normal = [builder.fsub(ay, by), builder.fsub(bx, ax)]
        slack = builder.fmul(builder.fmul(sizes[one], sizes[other]), constant(_EDGE_SLACK))
        edges.append((normal, _minor(builder, ax, by, ay, bx), slack))
    return _reaches_inside(builder, edges, bounds)


def _minor(builder: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    return builder.fsub(builder.fmul(a, b), builder.fmul(c, d))


def _reaches_inside(builder: Any, edges: list[Any], bounds: list[Any]) -> Any:
    """Whether some place within bounds may be on the same side of all three edges.

    Each edge: factors of the place's two coordinates, what is added, room for rounding.
    """
    leftmost, rightmost = None, None
    for normal, offset, slack in edges:
        least, most = _span(builder, normal, [bounds[0], bounds[2]], [bounds[1], bounds[3]])
        most = builder.fadd(builder.fadd(most, offset), slack)
        least = builder.fsub(builder.fadd(least, offset), slack)
        leftmost = most if leftmost is None else smaller_of(builder, leftmost, most)
        rightmost = least if rightmost is None else larger_of(builder, rightmost, least)
    zero = constant(0.0)
    return builder.or_(
        builder.fcmp_unordered(">=", leftmost, zero), builder.fcmp_unordered("<=", rightmost, zero)
    )


@_intrinsic
def triangles_in_beam(typing_context, corners, block, axes, beam, farthest, places):  # type: ignore[no-untyped-def]
    """Which of a block's eight triangles a beam of rays may meet, and in which rows of its rays.

    Args:
        typing_context: numba's.
        corners: as for :func:`triangle_hits`.
        block: row of ``corners``.
        axes: ``(>= 13,)`` float32: two directions across the beam, its middle direction, and the
            least and largest slopes of its rays along the two.
        beam: as for :func:`boxes_in_beam`.
        farthest: ray parameter beyond which no hit is wanted.
        places: ``(>= 24,)`` float32, receives the least and largest slope of each triangle along
            the second direction, and a parameter before which no ray meets it.

    Returns:
        int64 whose bit ``k`` says that triangle ``k`` may be met.
    """
    signature = types.int64(corners, block, axes, beam, farthest, places)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, row, across, sides, far, out = unpack(context, builder, signature, args)

        def number(array: Any, place: int) -> Any:
            return splat(builder, builder.load(builder.gep(array, [ir.Constant(I64, place)])))

        origin = [number(sides, axis) for axis in range(3)]
        vectors = [[number(across, 3 * k + axis) for axis in range(3)] for k in range(3)]
        bounds = [number(across, 9 + k) for k in range(4)]
        first = builder.mul(row, ir.Constant(I64, 9))
        least: list[Any] = [None] * 3
        most: list[Any] = [None] * 3
        slack, nearest = None, None
        points: list[Any] = []
        sizes: list[Any] = []
        one, tiny = constant(1.0), constant(1e-6)
        for corner in range(3):
            point = [
                builder.fsub(
                    load_lanes(
                        builder, data, builder.add(first, ir.Constant(I64, 3 * corner + axis))
                    ),
                    origin[axis],
                )
                for axis in range(3)
            ]
            right, up, ahead = (_dot(builder, vector, point) for vector in vectors)
            size = builder.fadd(
                builder.fadd(_magnitude(builder, point[0]), _magnitude(builder, point[1])),
                _magnitude(builder, point[2]),
            )
            points.append((right, up, ahead))
            sizes.append(size)
            inverse = builder.fdiv(one, ahead)
            size = builder.fmul(size, tiny)
            off = builder.fmul(size, inverse)
            slack = off if slack is None else larger_of(builder, slack, off)
            certain = builder.fsub(ahead, size)
            nearest = certain if nearest is None else smaller_of(builder, nearest, certain)
            for k, value in enumerate(
                (builder.fmul(right, inverse), builder.fmul(up, inverse), ahead)
            ):
                held, top = least[k], most[k]
                least[k] = value if held is None else smaller_of(builder, held, value)
                most[k] = value if top is None else larger_of(builder, top, value)
        slack = builder.fadd(slack, tiny)
        within = None
        for k in range(2):
            low, high = builder.fsub(least[k], slack), builder.fadd(most[k], slack)
            if k == 1:
                rows = (low, high)
            overlap = builder.and_(
                builder.fcmp_ordered("<=", low, bounds[2 * k + 1]),
                builder.fcmp_ordered(">=", high, bounds[2 * k]),
            )
            within = overlap if within is None else builder.and_(within, overlap)
        # What reaches behind the origin has no such place: it is taken for everywhere.
        front = builder.fcmp_ordered(">", least[2], constant(1e-3))
        somewhere = builder.fcmp_ordered(">=", most[2], constant(0.0))
        reach = builder.fmul(nearest, number(sides, 18))
        near = builder.fcmp_ordered("<=", reach, splat(builder, far))
        huge = 3.0e38
        for k, (value, otherwise) in enumerate(((rows[0], -huge), (rows[1], huge), (reach, -huge))):
            store_lanes(builder, builder.select(front, value, constant(otherwise)), out, k)
        met = builder.select(front, builder.and_(within, near), somewhere)
        return bits_of(builder, builder.and_(met, _straddled(builder, points, sizes, bounds)))

    return signature, codegen


@_intrinsic
def rays_hit(  # type: ignore[no-untyped-def]
    typing_context, corners, block, lane, kx, ky, kz, beam, rays, rows, low, found
):
    """Which of 64 rays of one origin meet a triangle, at most as far as they have come.

    The operations are those of :func:`triangle_hits`, in the same order: the results are equal.

    Args:
        typing_context: numba's.
        corners, block: as for :func:`triangle_hits`.
        lane: the triangle.
        kx, ky, kz: axes in the order that puts the directions' largest component last.
        beam: as for :func:`boxes_in_beam`.
        rays: ``(4, PACKET)`` float32 for each ray: its shear, and the largest parameter that
            counts.
        rows: a bit for each eight of the rays that are asked.
        low: smallest parameter that counts.
        found: ``(3, PACKET)`` float32, receives what :func:`triangle_hits` finds, of each ray.

    Returns:
        int64 whose bit ``k`` says that ray ``k`` meets the triangle.
    """
    signature = types.int64(corners, block, lane, kx, ky, kz, beam, rays, rows, low, found)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, number, place, *axes, sides, lanes, which, least, out = unpack(
            context, builder, signature, args
        )
        first = builder.mul(number, ir.Constant(I64, 9 * LANES))
        first = builder.add(first, place)
        origin = [builder.load(builder.gep(sides, [axis])) for axis in axes]
        seen = [
            [
                splat(builder, builder.fsub(_corner(builder, data, first, axis, corner), start))
                for axis, start in zip(axes, origin, strict=True)
            ]
            for corner in range(3)
        ]
        low = splat(builder, least)

        def meet_row(row: Any) -> Any:
            shear_x, shear_y, shear_z, farthest = (
                load_lanes(builder, lanes, builder.add(ir.Constant(I64, k * PACKET // LANES), row))
                for k in range(4)
            )
            xs = [builder.fsub(x, builder.fmul(shear_x, z)) for x, _, z in seen]
            ys = [builder.fsub(y, builder.fmul(shear_y, z)) for _, y, z in seen]
            zs = [builder.fmul(shear_z, z) for _, _, z in seen]
            places = _rows_of_found(builder, row)
            return meet_triangles(builder, xs, ys, zs, low, farthest, out, places)

        return _in_rows(builder, which, meet_row)

    return signature, codegen


@_intrinsic
def largest(typing_context, numbers, begin, groups):  # type: ignore[no-untyped-def]
    """Largest of ``8 * groups`` float32 numbers from number ``8 * begin`` on."""
    signature = types.float32(numbers, begin, groups)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, first, count = unpack(context, builder, signature, args)
        most = new_variable(builder, load_lanes(builder, data, first))
        with cgutils.for_range(builder, count) as loop:
            value = load_lanes(builder, data, builder.add(first, loop.index))
            builder.store(larger_of(builder, builder.load(most), value), most)
        vector = builder.load(most)
        undefined = ir.Constant(REALS, ir.Undefined)
        for half in (4, 2, 1):
            order = [k + half if k + half < LANES else k for k in range(LANES)]
            mask = ir.Constant(ir.VectorType(I32, LANES), order)
            vector = larger_of(builder, vector, builder.shuffle_vector(vector, undefined, mask))
        return builder.extract_element(vector, ir.Constant(I32, 0))

    return signature, codegen


def _numbers(builder: Any, array: Any, places: range) -> list[Any]:
    """Numbers of a float32 array, each eight times."""
    return [
        splat(builder, builder.load(builder.gep(array, [ir.Constant(I64, place)])))
        for place in places
    ]


def _overlap(builder: Any, spans: list[tuple[Any, Any]], bounds: list[Any]) -> Any:
    """Where all intervals meet theirs of ``bounds``: least, largest, least, largest, ..."""
    met = None
    for k, (low, high) in enumerate(spans):
        both = builder.and_(
            builder.fcmp_ordered("<=", low, bounds[2 * k + 1]),
            builder.fcmp_ordered(">=", high, bounds[2 * k]),
        )
        met = both if met is None else builder.and_(met, both)
    return met


@_intrinsic
def boxes_in_shaft(typing_context, planes, node, shaft, entry):  # type: ignore[no-untyped-def]
    """Which of a node's eight boxes parallel rays may meet.

    Args:
        typing_context: numba's.
        planes, node: as for :func:`box_hits`.
        shaft: ``(>= 18,)`` float32: a place near all origins; two directions across the rays and
            their own; the least and largest place along each of the three that they reach.
        entry: ``(>= 8,)`` float32, receives where each box begins along the rays.

    Returns:
        int64 whose bit ``k`` says that box ``k`` may be met.
    """
    signature = types.int64(planes, node, shaft, entry)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, row, numbers, out = unpack(context, builder, signature, args)
        first = builder.mul(row, ir.Constant(I64, 6))
        origin = _numbers(builder, numbers, range(3))
        sides = [
            builder.fsub(
                load_lanes(builder, data, builder.add(first, ir.Constant(I64, k))), origin[k % 3]
            )
            for k in range(6)
        ]
        slack = builder.fmul(_reach(builder, sides[:3], sides[3:]), constant(1e-6))
        spans = []
        for k in (3, 6, 9):
            vector = _numbers(builder, numbers, range(k, k + 3))
            least, most = _span(builder, vector, sides[:3], sides[3:])
            spans.append((builder.fsub(least, slack), builder.fadd(most, slack)))
        store_lanes(builder, spans[2][0], out, 0)
        met = _overlap(builder, spans, _numbers(builder, numbers, range(12, 18)))
        exists = builder.fcmp_ordered("<=", sides[0], sides[3])
        return bits_of(builder, builder.and_(met, exists))

    return signature, codegen


@_intrinsic
def triangles_in_shaft(typing_context, corners, block, shaft, places):  # type: ignore[no-untyped-def]
    """Which of a block's eight triangles parallel rays may meet, and where across them they are.

    Args:
        typing_context: numba's.
        corners, block: as for :func:`triangle_hits`.
        shaft: as for :func:`boxes_in_shaft`; and at last how far the origins are from its place.
        places: ``(>= 32,)`` float32, receives the least and the largest place of each triangle
            along the first and along the second direction.

    Returns:
        int64 whose bit ``k`` says that triangle ``k`` may be met.
    """
    signature = types.int64(corners, block, shaft, places)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, row, numbers, out = unpack(context, builder, signature, args)
        origin = _numbers(builder, numbers, range(3))
        vectors = [_numbers(builder, numbers, range(k, k + 3)) for k in (3, 6, 9)]
        first = builder.mul(row, ir.Constant(I64, 9))
        least: list[Any] = [None] * 3
        most: list[Any] = [None] * 3
        slack = None
        points: list[Any] = []
        sizes: list[Any] = []
        (around,) = _numbers(builder, numbers, range(18, 19))
        for corner in range(3):
            point = [
                builder.fsub(
                    load_lanes(
                        builder, data, builder.add(first, ir.Constant(I64, 3 * corner + axis))
                    ),
                    origin[axis],
                )
                for axis in range(3)
            ]
            size = builder.fadd(
                builder.fadd(_magnitude(builder, point[0]), _magnitude(builder, point[1])),
                _magnitude(builder, point[2]),
            )
            slack = size if slack is None else larger_of(builder, slack, size)
            sizes.append(builder.fadd(size, around))
            across = [_dot(builder, vector, point) for vector in vectors]
            points.append(across[:2])
            for k, value in enumerate(across):
                held, top = least[k], most[k]
                least[k] = value if held is None else smaller_of(builder, held, value)
                most[k] = value if top is None else larger_of(builder, top, value)
        slack = builder.fmul(slack, constant(1e-6))
        spans = [
            (builder.fsub(low, slack), builder.fadd(high, slack))
            for low, high in zip(least, most, strict=True)
        ]
        for k in range(2):
            store_lanes(builder, spans[k][0], out, 2 * k)
            store_lanes(builder, spans[k][1], out, 2 * k + 1)
        bounds = _numbers(builder, numbers, range(12, 18))
        met = _overlap(builder, spans, bounds)
        return bits_of(
            builder, builder.and_(met, _straddled_along(builder, points, sizes, bounds[:4]))
        )

    return signature, codegen


@_intrinsic
def parallel_rays_hit(  # type: ignore[no-untyped-def]
    typing_context, corners, block, lane, kx, ky, kz, starts, sx, sy, sz, rays, rows, low, found
):
    """Which of 64 parallel rays meet a triangle, at most as far as they have come.

    The operations are those of :func:`triangle_hits`, in the same order: the results are equal.

    Args:
        typing_context: numba's.
        corners, block, kx, ky, kz, sx, sy, sz: as for :func:`triangle_hits`.
        lane: the triangle.
        starts: ``(3, PACKET)`` float32 origins of the rays.
        rays: ``(4, PACKET)`` float32, in its last row the largest parameter that counts.
        rows: a bit for each eight of the rays that are asked.
        low: smallest parameter that counts.
        found: as for :func:`rays_hit`.

    Returns:
        int64 whose bit ``k`` says that ray ``k`` meets the triangle.
    """
    signature = types.int64(
        corners, block, lane, kx, ky, kz, starts, sx, sy, sz, rays, rows, low, found
    )

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, number, place, *axes, origins, sx, sy, sz, lanes, which, least, out = unpack(
            context, builder, signature, args
        )
        stride = ir.Constant(I64, PACKET // LANES)
        shear_x, shear_y, shear_z = (splat(builder, value) for value in (sx, sy, sz))
        first = builder.add(builder.mul(number, ir.Constant(I64, 9 * LANES)), place)
        corner_at = [
            [splat(builder, _corner(builder, data, first, axis, corner)) for axis in axes]
            for corner in range(3)
        ]
        low = splat(builder, least)

        def meet_row(row: Any) -> Any:
            start = [
                load_lanes(builder, origins, builder.add(builder.mul(axis, stride), row))
                for axis in axes
            ]
            last = ir.Constant(I64, 3 * PACKET // LANES)
            farthest = load_lanes(builder, lanes, builder.add(last, row))
            xs, ys, zs = [], [], []
            for corner in corner_at:
                x, y, z = (builder.fsub(a, b) for a, b in zip(corner, start, strict=True))
                xs.append(builder.fsub(x, builder.fmul(shear_x, z)))
                ys.append(builder.fsub(y, builder.fmul(shear_y, z)))
                zs.append(builder.fmul(shear_z, z))
            places = _rows_of_found(builder, row)
            return meet_triangles(builder, xs, ys, zs, low, farthest, out, places)

        return _in_rows(builder, which, meet_row)

    return signature, codegen


def _rows_between(
    builder: Any, bounds: Any, places: Any, lane: Any, spans: int
) -> tuple[Any, Callable[[int], Any]]:
    """Which rows of rays a triangle may reach across them; how to read its further places."""

    def place(row: int) -> Any:
        index = builder.add(lane, ir.Constant(I64, row * LANES))
        return splat(builder, builder.load(builder.gep(places, [index])))

    met = None
    for k in range(spans):
        low, high = (load_lanes(builder, bounds, ir.Constant(I64, 2 * k + end)) for end in range(2))
        both = builder.and_(
            builder.fcmp_unordered(">=", place(2 * k + 1), low),
            builder.fcmp_unordered("<=", place(2 * k), high),
        )
        met = both if met is None else builder.and_(met, both)
    return met, place


@_intrinsic
def rows_in_beam(typing_context, bounds, places, lane):  # type: ignore[no-untyped-def]
    """Which rows of eight rays of a beam a triangle may be met by.

    Args:
        typing_context: numba's.
        bounds: ``(>= 3, 8)`` float32 least and largest slope of each row along the second
            direction, and the parameter beyond which none of its rays wants a hit.
        places: as :func:`triangles_in_beam` leaves it.
        lane: the triangle.

    Returns:
        int64 with a bit for each row.
    """
    signature = types.int64(bounds, places, lane)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        rows, data, number = unpack(context, builder, signature, args)
        met, place = _rows_between(builder, rows, data, number, 1)
        farthest = load_lanes(builder, rows, ir.Constant(I64, 2))
        near = builder.fcmp_unordered("<=", place(2), farthest)
        return bits_of(builder, builder.and_(met, near))

    return signature, codegen


@_intrinsic
def rows_in_shaft(typing_context, bounds, places, lane):  # type: ignore[no-untyped-def]
    """Which rows of eight parallel rays a triangle may be met by.

    Args:
        typing_context: numba's.
        bounds: ``(>= 5, 8)`` float32 least and largest place of each row along the first and along
            the second direction across the rays, and a negative number where a row wants no hit.
        places: as :func:`triangles_in_shaft` leaves it.
        lane: the triangle.

    Returns:
        int64 with a bit for each row.
    """
    signature = types.int64(bounds, places, lane)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        rows, data, number = unpack(context, builder, signature, args)
        met, _ = _rows_between(builder, rows, data, number, 2)
        farthest = load_lanes(builder, rows, ir.Constant(I64, 4))
        wanted = builder.fcmp_ordered(">=", farthest, constant(0.0))
        return bits_of(builder, builder.and_(met, wanted))

    return signature, codegen
