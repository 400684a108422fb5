"""Tests of a shaft, parallel rays, with boxes and triangles, as LLVM vector code."""

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
    overlapping,
    reaches_inside,
    rows_between,
    rows_of_found,
)
from carstage_sim.render.simd import meet_triangles, slab_rows, slabs_crossed
from carstage_sim.render.vector_code import (
    F32,
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

_intrinsic: Decorator = intrinsic


@_intrinsic
def boxes_in_shaft(  # type: ignore[no-untyped-def]
    typing_context, planes, node, near_x, near_y, near_z, shaft, low, high, entry
):
    """Which of a node's eight boxes parallel rays may meet.

    What :func:`box_hits` finds for any of the rays is found: its operations, with the bounds of
    what they are given for each ray.

    Args:
        typing_context: numba's.
        planes, node, near_x, near_y, near_z, low, high: as for :func:`box_hits`.
        shaft: ``(>= 28,)`` float32: a place near all origins; two directions across the rays and
            their own; the least and largest place along each of the three that they reach; how far
            the origins are from the place; from 19 on the reciprocal of the direction, of the
            origins' coordinates those that see each first plane soonest, and each last plane last.
        entry: ``(>= 8,)`` float32, receives where each box is entered.

    Returns:
        int64 whose bit ``k`` says that box ``k`` may be met.
    """
    signature = types.int64(planes, node, near_x, near_y, near_z, shaft, low, high, entry)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, row, *nears, numbers, least, most, out = unpack(context, builder, signature, args)
        inverse, first, last = (numbers_at(builder, numbers, range(k, k + 3)) for k in (19, 22, 25))
        enters: list[Any] = []
        leaves: list[Any] = []
        for axis, rows in enumerate(slab_rows(builder, row, nears)):
            for found, plane, start in zip((enters, leaves), rows, (first, last), strict=True):
                distance = builder.fsub(load_lanes(builder, data, plane), start[axis])
                found.append(builder.fmul(distance, inverse[axis]))
        limits = splat(builder, least), splat(builder, most)
        return slabs_crossed(builder, enters, leaves, *limits, out)

    return signature, codegen


@_intrinsic
def enclose_starts(typing_context, starts, groups, shaft, slack, slopes):  # type: ignore[no-untyped-def]
    """How far the origins of parallel rays are from a place, along and across their direction.

    Their least and largest coordinates come from 22 on in ``shaft``: three, then three.

    Args:
        typing_context: numba's.
        starts: ``(3, PACKET)`` float32 origins.
        groups: how many rows of eight there are.
        shaft: as for :func:`boxes_in_shaft`, where the bounds are filled in.
        slack: room to leave across the rays, metres.
        slopes: ``(>= 4, 8)`` float32, receives the bounds of each row across the rays.
    """
    signature = types.void(starts, groups, shaft, slack, slopes)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, count, numbers, margin, rows = unpack(context, builder, signature, args)
        origin = numbers_at(builder, numbers, range(3))
        vectors = [numbers_at(builder, numbers, range(k, k + 3)) for k in (3, 6, 9)]
        begins, joins = (float("inf"), float("-inf")), (smaller_of, larger_of)
        held = [[new_variable(builder, constant(value)) for value in begins] for _ in vectors]
        corners = [[new_variable(builder, constant(value)) for _ in range(3)] for value in begins]
        stride = ir.Constant(I64, PACKET // LANES)
        out_by = (builder.fsub(ir.Constant(F32, 0.0), margin), margin)
        with cgutils.for_range(builder, count) as loop:
            point = []
            for axis in range(3):
                row = builder.add(builder.mul(ir.Constant(I64, axis), stride), loop.index)
                place = load_lanes(builder, data, row)
                for corner, join in zip(corners, joins, strict=True):
                    one = corner[axis]
                    builder.store(join(builder, builder.load(one), place), one)
                point.append(builder.fsub(place, origin[axis]))
            for k, vector in enumerate(vectors):
                place = dot(builder, vector, point)
                for end, join in enumerate(joins):
                    one = held[k][end]
                    builder.store(join(builder, builder.load(one), place), one)
                    if k < 2:
                        value = builder.fadd(across_lanes(builder, place, join), out_by[end])
                        index = builder.add(loop.index, ir.Constant(I64, (2 * k + end) * LANES))
                        builder.store(value, number_at(builder, rows, index))
        for k in range(3):
            for end, join in enumerate(joins):
                value = across_lanes(builder, builder.load(held[k][end]), join)
                if k < 2:
                    value = builder.fadd(value, out_by[end])
                builder.store(value, number_at(builder, numbers, 12 + 2 * k + end))
        for end, join in enumerate(joins):
            for axis in range(3):
                value = across_lanes(builder, builder.load(corners[end][axis]), join)
                builder.store(value, number_at(builder, numbers, 22 + 3 * end + axis))
        return context.get_dummy_value()

    return signature, codegen


def _straddled_along(builder: Any, points: list[Any], sizes: list[Any], bounds: list[Any]) -> Any:
    """As :func:`_straddled`, of parallel rays.

    Args:
        builder: LLVM's.
        points: the three corners: across the rays.
        sizes: how far they are from the rays' origins at most.
        bounds: least and largest places of the rays.
    """
    edges: list[tuple[Any, Any, Any]] = []
    for one, other in EDGES:
        (ax, ay), (bx, by) = points[one], points[other]
        normal = [builder.fsub(ay, by), builder.fsub(bx, ax)]
        slack = builder.fmul(builder.fmul(sizes[one], sizes[other]), constant(EDGE_SLACK))
        edges.append((normal, minor(builder, ax, by, ay, bx), slack))
    return reaches_inside(builder, edges, bounds)


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
        origin = numbers_at(builder, numbers, range(3))
        vectors = [numbers_at(builder, numbers, range(k, k + 3)) for k in (3, 6, 9)]
        first = builder.mul(row, ir.Constant(I64, 9))
        least: list[Any] = [None] * 3
        most: list[Any] = [None] * 3
        slack = None
        points: list[Any] = []
        sizes: list[Any] = []
        (around,) = numbers_at(builder, numbers, range(18, 19))
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
                builder.fadd(magnitude(builder, point[0]), magnitude(builder, point[1])),
                magnitude(builder, point[2]),
            )
            slack = size if slack is None else larger_of(builder, slack, size)
            sizes.append(builder.fadd(size, around))
            across = [dot(builder, vector, point) for vector in vectors]
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
        bounds = numbers_at(builder, numbers, range(12, 18))
        met = overlapping(builder, spans, bounds)
        return bits_of(
            builder, builder.and_(met, _straddled_along(builder, points, sizes, bounds[:4]))
        )

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
        met, _ = rows_between(builder, rows, data, number, 2)
        farthest = load_lanes(builder, rows, ir.Constant(I64, 4))
        wanted = builder.fcmp_ordered(">=", farthest, constant(0.0))
        return bits_of(builder, builder.and_(met, wanted))

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
            [splat(builder, corner_of(builder, data, first, axis, corner)) for axis in axes]
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
            places = rows_of_found(builder, row)
            return meet_triangles(builder, xs, ys, zs, low, farthest, out, places)

        return in_rows(builder, which, meet_row)

    return signature, codegen
