"""Six layers of noise at once, written as LLVM vector code.

The operations are those of :func:`carstage_sim.render.detail.noise`, in the same order; so are the
results. The graphics card's shaders are translated from the function that calls it six times.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from carstage_sim.kernels import Decorator

_LAYERS = 6
_LANES = 8
_F32, _I32 = ir.FloatType(), ir.IntType(32)
_REALS, _WHOLES = ir.VectorType(_F32, _LANES), ir.VectorType(_I32, _LANES)
_intrinsic: Decorator = intrinsic
_several: Any = types.UniTuple
_function: Any = cgutils.get_or_insert_function
_packed: Any = cgutils.pack_array


def side_by_side(reference: Callable[..., Any]) -> Any:
    """The vector code for a function ``(x, y, six sizes, seed)`` that gives six noises."""

    @_intrinsic
    def noises(typing_context, x, y, a, b, c, d, e, f, seed):  # type: ignore[no-untyped-def]
        real = types.float32
        signature = _several(real, _LAYERS)(*[real] * (2 + _LAYERS), types.int64)
        return signature, _codegen

    noises.py_func = getattr(reference, "py_func", reference)  # type: ignore[attr-defined]
    return noises


def _real(value: float) -> Any:
    return ir.Constant(_REALS, [ir.Constant(_F32, value)] * _LANES)


def whole(value: int) -> Any:
    """A whole number in each lane, of which 32 bits are kept."""
    return ir.Constant(_WHOLES, [ir.Constant(_I32, value & 0xFFFFFFFF)] * _LANES)


def _splat(builder: Any, scalar: Any) -> Any:
    first = builder.insert_element(ir.Constant(_REALS, None), scalar, ir.Constant(_I32, 0))
    mask = ir.Constant(_WHOLES, [0] * _LANES)
    return builder.shuffle_vector(first, ir.Constant(_REALS, None), mask)


def hash_lanes(builder: Any, mixed: Any) -> Any:
    """A number in [0, 1) of each lane; see ``detail.hash_unit``."""
    h = builder.mul(builder.xor(mixed, builder.lshr(mixed, whole(13))), whole(1274126177))
    h = builder.mul(builder.xor(h, builder.lshr(h, whole(16))), whole(2654435761))
    unit = builder.uitofp(builder.lshr(h, whole(8)), _REALS)
    return builder.fmul(unit, _real(1.0 / 16777216.0))


def _codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    x, y, *sizes, seed = args
    size = _real(1.0)
    seeds: Any = ir.Constant(_WHOLES, None)
    first = builder.trunc(seed, _I32)
    for k, value in enumerate(sizes):
        lane = ir.Constant(_I32, k)
        size = builder.insert_element(size, value, lane)
        number = builder.add(first, lane)
        seeds = builder.insert_element(seeds, number, lane)
    kind = ir.FunctionType(_REALS, [_REALS])
    floor = _function(builder.module, kind, f"llvm.floor.v{_LANES}f32")

    def place(value: Any) -> tuple[Any, Any]:
        scaled = builder.fdiv(_splat(builder, value), size)
        below = builder.call(floor, [scaled])
        u = builder.fsub(scaled, below)
        eased = builder.fmul(builder.fmul(u, u), builder.fsub(_real(3.0), builder.fadd(u, u)))
        return builder.fptosi(below, _WHOLES), eased

    (i, u), (j, v) = place(x), place(y)
    seeded = builder.mul(seeds, whole(2246822519))
    across = (
        builder.mul(i, whole(374761393)),
        builder.mul(builder.add(i, whole(1)), whole(374761393)),
    )
    down = (
        builder.mul(j, whole(668265263)),
        builder.mul(builder.add(j, whole(1)), whole(668265263)),
    )
    corners = [
        hash_lanes(builder, builder.add(builder.add(column, row), seeded))
        for row in down
        for column in across
    ]
    a, b, c, d = corners
    low = builder.fadd(a, builder.fmul(builder.fsub(b, a), u))
    high = builder.fadd(c, builder.fmul(builder.fsub(d, c), u))
    value = builder.fadd(low, builder.fmul(builder.fsub(high, low), v))
    noise = builder.fsub(builder.fadd(value, value), _real(1.0))
    found = [builder.extract_element(noise, ir.Constant(_I32, k)) for k in range(_LAYERS)]
    return _packed(builder, found)
