"""Tests of a beam, rays from one place, with boxes and triangles, as LLVM vector code."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from carstage_sim.kernels import Decorator
from carstage_sim.render.packet_simd import (
    EDGE_SLACK,
    EDGES,
    PACKET,
    across_lanes,
    corner_of,
    dot,
    in_rows,
    magnitude,
    minor,
    number_at,
    numbers_at,
    reach_of,
    reaches_inside,
    rows_between,
    rows_of_found,
    span_of,
)
from carstage_sim.render.simd import meet_triangles, slab_rows, slabs_crossed
from carstage_sim.render.vector_code import (
    I64,
    LANES,
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

_BEAM_SLACK = 3e-6
"""Share of a box's largest coordinates that allows for rounding: normals of a beam's sides have
components below 2.8."""

_intrinsic: Decorator = intrinsic


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
        slack = builder.fmul(reach_of(builder, lowest, highest), constant(_BEAM_SLACK))
        least_off = builder.fsub(constant(0.0), slack)
        met = builder.fcmp_ordered("<=", lowest[0], highest[0])
        for side in range(5):
            normal = [splat(builder, number(3 + 3 * side + axis)) for axis in range(3)]
            least, most = span_of(builder, normal, lowest, highest)
            met = builder.and_(met, builder.fcmp_ordered(">=", most, least_off))
        enters = builder.fmul(builder.fsub(least, slack), splat(builder, number(18)))
        enters = larger_of(builder, enters, constant(0.0))
        met = builder.and_(met, builder.fcmp_ordered("<=", enters, splat(builder, far)))
        store_lanes(builder, enters, out, 0)
        return bits_of(builder, met)

    return signature, codegen


@_intrinsic
def boxes_in_slabs(  # type: ignore[no-untyped-def]
    typing_context, planes, node, near_x, near_y, near_z, beam, low, farthest, entry
):
    """As :func:`boxes_in_beam`, faster, for rays that agree on the sign of each component.

    What :func:`box_hits` finds for any of the rays is found: its operations, with the bounds of
    what they are given for each ray.

    Args:
        typing_context: numba's.
        planes, node, near_x, near_y, near_z, low: as for :func:`box_hits`.
        beam: ``(>= 25,)`` float32, from 19 on the least and largest reciprocal of the directions'
            components.
        farthest, entry: as for :func:`boxes_in_beam`.

    Returns:
        int64 whose bit ``k`` says that box ``k`` may be met.
    """
    signature = types.int64(planes, node, near_x, near_y, near_z, beam, low, farthest, entry)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, row, *nears, sides, least, far, out = unpack(context, builder, signature, args)
        origin = numbers_at(builder, sides, range(3))
        enters: list[Any] = []
        leaves: list[Any] = []
        for axis, rows in enumerate(slab_rows(builder, row, nears)):
            inverse = numbers_at(builder, sides, range(19 + 2 * axis, 21 + 2 * axis))
            for found, plane, join in zip(
                (enters, leaves), rows, (smaller_of, larger_of), strict=True
            ):
                distance = builder.fsub(load_lanes(builder, data, plane), origin[axis])
                ends = [builder.fmul(distance, one) for one in inverse]
                found.append(join(builder, *ends))
        limits = splat(builder, least), splat(builder, far)
        return slabs_crossed(builder, enters, leaves, *limits, out)

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
    for one, other in EDGES:
        (ax, ay, az), (bx, by, bz) = points[one], points[other]
        normal = [minor(builder, ay, bz, az, by), minor(builder, az, bx, ax, bz)]
        slack = builder.fmul(builder.fmul(sizes[one], sizes[other]), constant(EDGE_SLACK))
        edges.append((normal, minor(builder, ax, by, ay, bx), slack))
    return reaches_inside(builder, edges, bounds)


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
            right, up, ahead = (dot(builder, vector, point) for vector in vectors)
            size = builder.fadd(
                builder.fadd(magnitude(builder, point[0]), magnitude(builder, point[1])),
                magnitude(builder, point[2]),
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
        met, place = rows_between(builder, rows, data, number, 1)
        farthest = load_lanes(builder, rows, ir.Constant(I64, 2))
        near = builder.fcmp_unordered("<=", place(2), farthest)
        return bits_of(builder, builder.and_(met, near))

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
                splat(builder, builder.fsub(corner_of(builder, data, first, axis, corner), start))
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
            places = rows_of_found(builder, row)
            return meet_triangles(builder, xs, ys, zs, low, farthest, out, places)

        return in_rows(builder, which, meet_row)

    return signature, codegen


def _sum_of(builder: Any, a: Any, b: Any) -> Any:
    return builder.fadd(a, b)


def _rows_of(builder: Any, data: Any, group: Any) -> list[Any]:
    """Rows x, y and z of eight of 64 directions."""
    stride = PACKET // LANES
    return [
        load_lanes(builder, data, builder.add(group, ir.Constant(I64, axis * stride)))
        for axis in range(3)
    ]


@_intrinsic
def shear_rays(typing_context, ways, groups, main, rays, total):  # type: ignore[no-untyped-def]
    """Shear of rays for their triangle tests; whether all look along one axis.

    Args:
        typing_context: numba's.
        ways: ``(3, PACKET)`` float32 directions.
        groups: how many rows of eight there are.
        main: the axis.
        rays: ``(>= 3, PACKET)`` float32, receives the shear.
        total: ``(>= 9,)`` float32, receives the sum of the directions, and the least and largest of
            each of their components.

    Returns:
        int64, 0 where a ray has a larger component than the one along the axis.
    """
    signature = types.int64(ways, groups, main, rays, total)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, count, axis, out, sums = unpack(context, builder, signature, args)
        stride = ir.Constant(I64, PACKET // LANES)
        is_axis = [builder.icmp_signed("==", axis, ir.Constant(I64, k)) for k in range(2)]
        all_lanes = ir.Constant(I64, (1 << LANES) - 1)
        along = new_variable(builder, all_lanes)
        huge = float("inf")
        begins = (0.0,) * 3 + (huge, -huge) * 3
        joins = (_sum_of,) * 3 + (smaller_of, larger_of) * 3
        totals = [new_variable(builder, constant(value)) for value in begins]
        with cgutils.for_range(builder, count) as loop:
            d = _rows_of(builder, data, loop.index)
            of_each = (*d, *(value for value in d for _ in range(2)))
            for one, join, value in zip(totals, joins, of_each, strict=True):
                builder.store(join(builder, builder.load(one), value), one)
            x, y, z = (magnitude(builder, value) for value in d)
            first = builder.and_(builder.fcmp_ordered(">=", x, y), builder.fcmp_ordered(">=", x, z))
            second = builder.and_(builder.not_(first), builder.fcmp_ordered(">=", y, z))
            third = builder.not_(builder.or_(first, second))
            towards = builder.select(is_axis[0], first, builder.select(is_axis[1], second, third))
            bits = builder.and_(builder.load(along), bits_of(builder, towards))
            builder.store(bits, along)
            kx, ky, kz = (
                builder.select(
                    is_axis[0],
                    d[(k + 1) % 3],
                    builder.select(is_axis[1], d[(k + 2) % 3], d[k]),
                )
                for k in range(3)
            )
            inverse = builder.fdiv(constant(1.0), kz)
            shear = (builder.fmul(kx, inverse), builder.fmul(ky, inverse), inverse)
            for k, value in enumerate(shear):
                row = builder.add(builder.mul(ir.Constant(I64, k), stride), loop.index)
                store_lanes(builder, value, out, row)
        for k, (one, join) in enumerate(zip(totals, joins, strict=True)):
            value = across_lanes(builder, builder.load(one), join)
            builder.store(value, number_at(builder, sums, k))
        same = builder.icmp_unsigned("==", builder.load(along), all_lanes)
        return builder.zext(same, I64)

    return signature, codegen


@_intrinsic
def enclose_rays(typing_context, ways, groups, axes, least_ahead, slopes, bounds):  # type: ignore[no-untyped-def]
    """How far rays are from the middle direction of their beam; whether none strays too far.

    Args:
        typing_context: numba's.
        ways, groups: as for :func:`shear_rays`.
        axes: ``(>= 9,)`` float32: two directions across the beam, and its middle direction.
        least_ahead: square of the least cosine with the middle direction.
        slopes: ``(>= 2, 8)`` float32, receives the least and largest slope of each row along the
            second direction.
        bounds: ``(>= 5,)`` float32, receives the least and largest slope of all along the first
            direction, those along the second, and the largest component along the middle one.

    Returns:
        int64, 0 where a ray strays.
    """
    signature = types.int64(ways, groups, axes, least_ahead, slopes, bounds)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, count, across, least, rows, out = unpack(context, builder, signature, args)
        vectors = [numbers_at(builder, across, range(k, k + 3)) for k in (0, 3, 6)]
        all_lanes = ir.Constant(I64, (1 << LANES) - 1)
        near = new_variable(builder, all_lanes)
        huge = float("inf")
        begins = (huge, -huge, huge, -huge, 0.0)
        joins = (smaller_of, larger_of, smaller_of, larger_of, larger_of)
        held = [new_variable(builder, constant(value)) for value in begins]
        limit, zero = splat(builder, least), constant(0.0)
        with cgutils.for_range(builder, count) as loop:
            d = _rows_of(builder, data, loop.index)
            right, up, ahead = (dot(builder, vector, d) for vector in vectors)
            straight = dot(builder, d, d)
            inside = builder.and_(
                builder.fcmp_ordered(">", ahead, zero),
                builder.fcmp_ordered(
                    ">", builder.fmul(ahead, ahead), builder.fmul(limit, straight)
                ),
            )
            builder.store(builder.and_(builder.load(near), bits_of(builder, inside)), near)
            inverse = builder.fdiv(constant(1.0), ahead)
            u, v = builder.fmul(right, inverse), builder.fmul(up, inverse)
            for one, join, value in zip(held, joins, (u, u, v, v, ahead), strict=True):
                builder.store(join(builder, builder.load(one), value), one)
            for k, join in enumerate((smaller_of, larger_of)):
                place = builder.add(loop.index, ir.Constant(I64, k * LANES))
                builder.store(across_lanes(builder, v, join), number_at(builder, rows, place))
        for k, (one, join) in enumerate(zip(held, joins, strict=True)):
            builder.store(
                across_lanes(builder, builder.load(one), join), number_at(builder, out, k)
            )
        return builder.zext(builder.icmp_unsigned("==", builder.load(near), all_lanes), I64)

    return signature, codegen
