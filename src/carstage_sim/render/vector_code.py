"""Vectors of eight numbers in LLVM code, which numba has no types for.

LLVM splits the vectors on CPUs with narrower registers, with the same result: no operation is
contracted or reordered, so all machines agree to the last bit.
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
"""Numbers of a vector; children of a node and triangles of a leaf block."""

_array_struct: Any = make_array
_intrinsic: Decorator = intrinsic
new_variable: Any = cgutils.alloca_once_value
_function: Any = cgutils.get_or_insert_function

F32 = ir.FloatType()
I32 = ir.IntType(32)
I64 = ir.IntType(64)
REALS = ir.VectorType(F32, LANES)


def splat(builder: Any, scalar: Any) -> Any:
    """A number, eight times."""
    zero = ir.Constant(REALS, None)
    first = builder.insert_element(zero, scalar, ir.Constant(I32, 0))
    mask = ir.Constant(ir.VectorType(I32, LANES), [0] * LANES)
    return builder.shuffle_vector(first, zero, mask)


def constant(value: float) -> Any:
    """A number that is known now, eight times."""
    return ir.Constant(REALS, [ir.Constant(F32, value)] * LANES)


def _lane_pointer(builder: Any, data: Any, row: Any) -> Any:
    """Address of the eight floats number ``row`` of a flat float32 array."""
    offset = builder.mul(row, ir.Constant(I64, LANES))
    return builder.bitcast(builder.gep(data, [offset]), REALS.as_pointer())


def load_lanes(builder: Any, data: Any, row: Any) -> Any:
    """The eight floats number ``row`` of a flat float32 array."""
    return builder.load(_lane_pointer(builder, data, row), align=4)


def store_lanes(builder: Any, value: Any, data: Any, row: Any) -> None:
    """Write the eight floats number ``row`` of a flat float32 array."""
    place = ir.Constant(I64, row) if isinstance(row, int) else row
    builder.store(value, _lane_pointer(builder, data, place), align=4)


def larger_of(builder: Any, a: Any, b: Any) -> Any:
    """The larger of two numbers in each lane; ``b`` where either is no number."""
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


def smaller_of(builder: Any, a: Any, b: Any) -> Any:
    """The smaller of two numbers in each lane; ``b`` where either is no number."""
    return builder.select(builder.fcmp_ordered("<", a, b), a, b)


def bits_of(builder: Any, lanes: Any) -> Any:
    """Eight booleans as the low eight bits of an int64."""
    return builder.zext(builder.bitcast(lanes, ir.IntType(LANES)), I64)


@_intrinsic
def real_at(typing_context, numbers, place):  # type: ignore[no-untyped-def]
    """A number of a flat float32 array, at a place that is not negative.

    Numba would ask whether it is: loops that do are not run eight at a time.
    """

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, index = unpack(context, builder, signature, args)
        return builder.load(builder.gep(data, [index]))

    return types.float32(numbers, place), codegen


@_intrinsic
def put_real(typing_context, numbers, place, value):  # type: ignore[no-untyped-def]
    """Write a number of a flat float32 array; see :func:`real_at`."""

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, index, number = unpack(context, builder, signature, args)
        builder.store(number, builder.gep(data, [index]))
        return context.get_dummy_value()

    return types.void(numbers, place, value), codegen


@_intrinsic
def fetch_ahead(typing_context, array, place):  # type: ignore[no-untyped-def]
    """Let the processor fetch what a flat number ``place`` of an array lies beside; a hint.

    Without it, a loop over scattered places waits for each of them in turn.
    """

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, index = unpack(context, builder, signature, args)
        byte = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [byte, I32, I32, I32])
        function = _function(builder.module, kind, "llvm.prefetch.p0i8")
        address = builder.bitcast(builder.gep(data, [index]), byte)
        read, near, of_data = (ir.Constant(I32, value) for value in (0, 3, 1))
        builder.call(function, [address, read, near, of_data])
        return context.get_dummy_value()

    return types.void(array, place), codegen


@_intrinsic
def pixels_apart(typing_context, codes, pixel, other, least):  # type: ignore[no-untyped-def]
    """Which of eight pixels differ from eight others by more than ``least`` in any code.

    Args:
        typing_context: numba's.
        codes: uint8, four of each pixel.
        pixel, other: the first of the eight, and of the others.
        least: 0 or more.

    Returns:
        int64 whose bit ``k`` says that the pixels ``k`` do.
    """

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, *pixels, limit = unpack(context, builder, signature, args)
        byte, count = ir.IntType(8), 4 * LANES
        kind = ir.VectorType(byte, count)
        nothing = ir.Constant(kind, None)
        one, two = (
            builder.load(
                builder.bitcast(
                    builder.gep(data, [builder.mul(k, ir.Constant(I64, 4))]), kind.as_pointer()
                ),
                align=1,
            )
            for k in pixels
        )
        more = builder.icmp_unsigned(">", one, two)
        apart = builder.select(more, builder.sub(one, two), builder.sub(two, one))
        most = ir.Constant(I64, 255)
        limit = builder.select(builder.icmp_signed("<", limit, most), limit, most)
        lane = builder.insert_element(nothing, builder.trunc(limit, byte), ir.Constant(I32, 0))
        mask = ir.Constant(ir.VectorType(I32, count), [0] * count)
        beyond = builder.icmp_unsigned(">", apart, builder.shuffle_vector(lane, nothing, mask))
        words = builder.bitcast(builder.sext(beyond, kind), ir.VectorType(I32, LANES))
        zeros = ir.Constant(ir.VectorType(I32, LANES), None)
        return bits_of(builder, builder.icmp_unsigned("!=", words, zeros))

    return types.int64(codes, pixel, other, least), codegen


def unpack(context: Any, builder: Any, signature: Any, args: Any) -> list[Any]:
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
