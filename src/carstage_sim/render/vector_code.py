"""Vectors of eight numbers in LLVM code, which numba has no types for.

LLVM splits the vectors on CPUs with narrower registers, with the same result: no operation is
contracted or reordered, so all machines agree to the last bit.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.np.arrayobj import make_array

LANES = 8
"""Numbers of a vector; children of a node and triangles of a leaf block."""

_array_struct: Any = make_array
new_variable: Any = cgutils.alloca_once_value

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
