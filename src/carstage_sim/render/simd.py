"""Eight-wide box and triangle tests, written as LLVM vector code.

numba has no vector types, and LLVM does not find these loops by itself. A wide node holds eight
child boxes and a leaf block eight triangles, each coordinate as eight consecutive float32; one call
tests all eight. LLVM splits the vectors on CPUs with narrower registers, with the same result:
no operation is contracted or reordered, so all machines agree to the last bit.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from carstage_sim.kernels import Decorator

LANES = 8
"""Children of a node and triangles of a leaf block."""

_intrinsic: Decorator = intrinsic
_array_struct: Any = make_array

_F32 = ir.FloatType()
_I32 = ir.IntType(32)
_I64 = ir.IntType(64)
_VEC = ir.VectorType(_F32, LANES)


def _splat(builder: Any, scalar: Any) -> Any:
    zero = ir.Constant(_VEC, None)
    first = builder.insert_element(zero, scalar, ir.Constant(_I32, 0))
    mask = ir.Constant(ir.VectorType(_I32, LANES), [0] * LANES)
    return builder.shuffle_vector(first, zero, mask)


def _constant(value: float) -> Any:
    return ir.Constant(_VEC, [ir.Constant(_F32, value)] * LANES)


def _lane_pointer(builder: Any, data: Any, row: Any) -> Any:
    """Address of the eight floats number ``row`` of a flat float32 array."""
    offset = builder.mul(row, ir.Constant(_I64, LANES))
    return builder.bitcast(builder.gep(data, [offset]), _VEC.as_pointer())


def _load(builder: Any, data: Any, row: Any) -> Any:
    return builder.load(_lane_pointer(builder, data, row), align=4)


def _store(builder: Any, value: Any, data: Any, row: int) -> None:
    pointer = _lane_pointer(builder, data, ir.Constant(_I64, row))
    builder.store(value, pointer, align=4)


def _larger(builder: Any, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


def _smaller(builder: Any, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered("<", a, b), a, b)


def _bits(builder: Any, lanes: Any) -> Any:
    """Eight booleans as the low eight bits of an int64."""
    return builder.zext(builder.bitcast(lanes, ir.IntType(LANES)), _I64)


def _unpack(context: Any, builder: Any, signature: Any, args: Any) -> list[Any]:
    """Arguments with arrays replaced by their data pointers, float scalars as float32."""
    values = []
    for kind, value in zip(signature.args, args, strict=True):
        if isinstance(kind, types.Array):
            values.append(_array_struct(kind)(context, builder, value).data)
        elif isinstance(kind, types.Float):
            values.append(context.cast(builder, value, kind, types.float32))
        else:
            values.append(context.cast(builder, value, kind, types.int64))
    return values


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
        int64 whose bit ``k`` says that box ``k`` is met. Rounding is met by growing each interval
        by one part in a million, so that no triangle of a box is lost.
    """
    signature = types.int64(
        planes, node, near_x, near_y, near_z, ox, oy, oz, ix, iy, iz, low, high, entry
    )

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        values = _unpack(context, builder, signature, args)
        data, row, nears = values[0], values[1], values[2:5]
        origin = [_splat(builder, v) for v in values[5:8]]
        inverse = [_splat(builder, v) for v in values[8:11]]
        enter, leave = _splat(builder, values[11]), _splat(builder, values[12])
        first = builder.mul(row, ir.Constant(_I64, 6))
        enters: list[Any] = []
        leaves: list[Any] = []
        for axis in range(3):
            near_row = builder.add(first, builder.add(nears[axis], ir.Constant(_I64, axis)))
            far_row = builder.add(first, builder.sub(ir.Constant(_I64, axis + 3), nears[axis]))
            for found, plane in ((enters, near_row), (leaves, far_row)):
                distance = builder.fsub(_load(builder, data, plane), origin[axis])
                found.append(builder.fmul(distance, inverse[axis]))
        grown_enter = _constant(1.0 - 1e-6)
        grown_leave = _constant(1.0 + 1e-6)
        nearest = _larger(builder, _larger(builder, enters[0], enters[1]), enters[2])
        farthest = _smaller(builder, _smaller(builder, leaves[0], leaves[1]), leaves[2])
        nearest = _larger(builder, builder.fmul(nearest, grown_enter), enter)
        farthest = _smaller(builder, builder.fmul(farthest, grown_leave), leave)
        _store(builder, nearest, values[13], 0)
        return _bits(builder, builder.fcmp_ordered("<=", nearest, farthest))

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
        values = _unpack(context, builder, signature, args)
        data, row, axes = values[0], values[1], values[2:5]
        origin = [_splat(builder, v) for v in values[5:8]]
        shear_x, shear_y, shear_z = (_splat(builder, v) for v in values[8:11])
        first = builder.mul(row, ir.Constant(_I64, 9))
        xs, ys, zs = [], [], []
        for corner in range(3):
            base = builder.add(first, ir.Constant(_I64, 3 * corner))
            x, y, z = (
                builder.fsub(_load(builder, data, builder.add(base, axis)), start)
                for axis, start in zip(axes, origin, strict=True)
            )
            xs.append(builder.fsub(x, builder.fmul(shear_x, z)))
            ys.append(builder.fsub(y, builder.fmul(shear_y, z)))
            zs.append(builder.fmul(shear_z, z))

        def edge(a: int, b: int) -> Any:
            return builder.fsub(builder.fmul(xs[a], ys[b]), builder.fmul(ys[a], xs[b]))

        u, v, w = edge(2, 1), edge(0, 2), edge(1, 0)
        zero = _constant(0.0)
        least = _smaller(builder, _smaller(builder, u, v), w)
        most = _larger(builder, _larger(builder, u, v), w)
        inside = builder.or_(
            builder.fcmp_ordered(">=", least, zero), builder.fcmp_ordered("<=", most, zero)
        )
        determinant = builder.fadd(builder.fadd(u, v), w)
        scaled = builder.fadd(
            builder.fadd(builder.fmul(u, zs[0]), builder.fmul(v, zs[1])), builder.fmul(w, zs[2])
        )
        inverse = builder.fdiv(_constant(1.0), determinant)
        t = builder.fmul(scaled, inverse)
        within = builder.and_(
            builder.fcmp_ordered(">=", t, _splat(builder, values[11])),
            builder.fcmp_ordered("<=", t, _splat(builder, values[12])),
        )
        solid = builder.fcmp_ordered("!=", determinant, zero)
        _store(builder, t, values[13], 0)
        _store(builder, builder.fmul(u, inverse), values[13], 1)
        _store(builder, builder.fmul(v, inverse), values[13], 2)
        return _bits(builder, builder.and_(builder.and_(inside, within), solid))

    return signature, codegen


@_intrinsic
def lowest_bit(typing_context, bits):  # type: ignore[no-untyped-def]
    """Number of the lowest set bit of a non-zero int64."""

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        return builder.cttz(args[0], cgutils.true_bit)

    return types.int64(types.int64), codegen
