"""Tests of one ray with eight boxes or eight triangles, written as LLVM vector code.

numba has no vector types, and LLVM does not find these loops by itself. A wide node holds eight
child boxes and a leaf block eight triangles, each coordinate as eight consecutive float32; one call
tests all eight.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from carstage_sim.kernels import Decorator
from carstage_sim.render.vector_code import (
    I64,
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


def meet_triangles(
    builder: Any, xs: Any, ys: Any, zs: Any, low: Any, high: Any, found: Any, places: Any
) -> Any:
    """Where eight rays meet eight triangles whose corners are sheared along the rays.

    Stores parameters and weights in rows ``places`` of ``found``; the bits say which do. Most often
    no ray is within its triangle's edges: then nothing is stored.
    """

    def edge(a: int, b: int) -> Any:
        return builder.fsub(builder.fmul(xs[a], ys[b]), builder.fmul(ys[a], xs[b]))

    u, v, w = edge(2, 1), edge(0, 2), edge(1, 0)
    zero = constant(0.0)
    least = smaller_of(builder, smaller_of(builder, u, v), w)
    most = larger_of(builder, larger_of(builder, u, v), w)
    inside = builder.or_(
        builder.fcmp_ordered(">=", least, zero), builder.fcmp_ordered("<=", most, zero)
    )
    nothing = ir.Constant(I64, 0)
    met = new_variable(builder, nothing)
    with builder.if_then(builder.icmp_unsigned("!=", bits_of(builder, inside), nothing)):
        determinant = builder.fadd(builder.fadd(u, v), w)
        scaled = builder.fadd(
            builder.fadd(builder.fmul(u, zs[0]), builder.fmul(v, zs[1])), builder.fmul(w, zs[2])
        )
        inverse = builder.fdiv(constant(1.0), determinant)
        t = builder.fmul(scaled, inverse)
        within = builder.and_(
            builder.fcmp_ordered(">=", t, low), builder.fcmp_ordered("<=", t, high)
        )
        solid = builder.fcmp_ordered("!=", determinant, zero)
        for value, place in zip(
            (t, builder.fmul(u, inverse), builder.fmul(v, inverse)), places, strict=True
        ):
            store_lanes(builder, value, found, place)
        bits = bits_of(builder, builder.and_(builder.and_(inside, within), solid))
        builder.store(bits, met)
    return builder.load(met)


def slabs_crossed(
    builder: Any, enters: list[Any], leaves: list[Any], low: Any, high: Any, entry: Any
) -> Any:
    """Bits of eight boxes whose three slabs are crossed at one time between ``low`` and ``high``.

    Stores in ``entry`` where each box is entered. Rounding is met by growing each interval by one
    part in a million, so that no triangle of a box is lost.
    """
    nearest = larger_of(builder, larger_of(builder, enters[0], enters[1]), enters[2])
    farthest = smaller_of(builder, smaller_of(builder, leaves[0], leaves[1]), leaves[2])
    nearest = larger_of(builder, builder.fmul(nearest, constant(1.0 - 1e-6)), low)
    farthest = smaller_of(builder, builder.fmul(farthest, constant(1.0 + 1e-6)), high)
    store_lanes(builder, nearest, entry, 0)
    return bits_of(builder, builder.fcmp_ordered("<=", nearest, farthest))


def slab_rows(builder: Any, node: Any, nears: list[Any]) -> list[tuple[Any, Any]]:
    """Rows of a node's planes that a ray meets first and last, of each axis.

    ``nears``: 0 where the ray runs upwards along the axis, 3 where downwards.
    """
    first = builder.mul(node, ir.Constant(I64, 6))
    return [
        (
            builder.add(first, builder.add(near, ir.Constant(I64, axis))),
            builder.add(first, builder.sub(ir.Constant(I64, axis + 3), near)),
        )
        for axis, near in enumerate(nears)
    ]


@_intrinsic
def box_hits(  # type: ignore[no-untyped-def]
    typing_context, planes, node, near_x, near_y, near_z, ox, oy, oz, ix, iy, iz, low, high, entry
):
    """Which of a node's eight boxes a ray enters between ``low`` and ``high``.

    Args:
        typing_context: numba's.
        planes: ``(N, 6, 8)`` float32: lowest x, y, z, then highest x, y, z of eight boxes.
        node: row of ``planes``.
        near_x, near_y, near_z: 0 where the ray runs upwards along the axis, 3 where downwards.
        ox, oy, oz: ray origin.
        ix, iy, iz: reciprocal of the ray direction, finite.
        low, high: interval of the ray parameter.
        entry: ``(>= 8,)`` float32, receives the parameter at which each box is entered.

    Returns:
        int64 whose bit ``k`` says that box ``k`` is met.
    """
    signature = types.int64(
        planes, node, near_x, near_y, near_z, ox, oy, oz, ix, iy, iz, low, high, entry
    )

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        values = unpack(context, builder, signature, args)
        data, row, nears = values[0], values[1], values[2:5]
        origin = [splat(builder, v) for v in values[5:8]]
        inverse = [splat(builder, v) for v in values[8:11]]
        enter, leave = splat(builder, values[11]), splat(builder, values[12])
        enters: list[Any] = []
        leaves: list[Any] = []
        for axis, rows in enumerate(slab_rows(builder, row, nears)):
            for found, plane in zip((enters, leaves), rows, strict=True):
                distance = builder.fsub(load_lanes(builder, data, plane), origin[axis])
                found.append(builder.fmul(distance, inverse[axis]))
        return slabs_crossed(builder, enters, leaves, enter, leave, values[13])

    return signature, codegen


@_intrinsic
def triangle_hits(  # type: ignore[no-untyped-def]
    typing_context, corners, block, kx, ky, kz, ox, oy, oz, sx, sy, sz, low, high, found
):
    """Which of a block's eight triangles a ray meets between ``low`` and ``high``, both sides.

    The watertight test of Woop, Benthin and Wald (JCGT 2013) without its double precision step:
    an edge function of exactly zero counts as inside, so an edge shared by two triangles is never
    missed by both.

    Args:
        typing_context: numba's.
        corners: ``(N, 9, 8)`` float32: x, y, z of the first, second and third corner.
        block: row of ``corners``.
        kx, ky, kz: axes in the order that puts the direction's largest component last.
        ox, oy, oz: ray origin along those axes.
        sx, sy, sz: the shear ``d[kx] / d[kz]``, ``d[ky] / d[kz]`` and ``1 / d[kz]``.
        low, high: interval of the ray parameter, both ends included.
        found: ``(>= 24,)`` float32, receives the parameter and the weights of the first and
            second corner, eight of each; valid where the bit is set.

    Returns:
        int64 whose bit ``k`` says that triangle ``k`` is met.
    """
    signature = types.int64(corners, block, kx, ky, kz, ox, oy, oz, sx, sy, sz, low, high, found)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        values = unpack(context, builder, signature, args)
        data, row, axes = values[0], values[1], values[2:5]
        origin = [splat(builder, v) for v in values[5:8]]
        shear_x, shear_y, shear_z = (splat(builder, v) for v in values[8:11])
        first = builder.mul(row, ir.Constant(I64, 9))
        xs, ys, zs = [], [], []
        for corner in range(3):
            base = builder.add(first, ir.Constant(I64, 3 * corner))
            x, y, z = (
                builder.fsub(load_lanes(builder, data, builder.add(base, axis)), start)
                for axis, start in zip(axes, origin, strict=True)
            )
            xs.append(builder.fsub(x, builder.fmul(shear_x, z)))
            ys.append(builder.fsub(y, builder.fmul(shear_y, z)))
            zs.append(builder.fmul(shear_z, z))
        low, high = (splat(builder, v) for v in values[11:13])
        return meet_triangles(builder, xs, ys, zs, low, high, values[13], range(3))

    return signature, codegen


@_intrinsic
def lowest_bit(typing_context, bits):  # type: ignore[no-untyped-def]
    """Number of the lowest set bit of a non-zero int64."""

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        return builder.cttz(args[0], cgutils.true_bit)

    return types.int64(types.int64), codegen
