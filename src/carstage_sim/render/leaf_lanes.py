"""Gaps between leaves of a card, asked of eight rays at once, written as LLVM vector code.

The operations are those of :func:`carstage_sim.render.leaves.leaf_at`, in the same order; so are
the results.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from carstage_sim.kernels import Decorator
from carstage_sim.render.leaves import ASIDE, BARE, GROWTH, LONG, SEED, WIDE
from carstage_sim.render.noise_lanes import hash_lanes, whole
from carstage_sim.render.packet_simd import PACKET, magnitude
from carstage_sim.render.vector_code import (
    F32,
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
    unpack,
)

_ROWS = PACKET // LANES
_WHOLES = ir.VectorType(I32, LANES)
_intrinsic: Decorator = intrinsic
_function: Any = cgutils.get_or_insert_function


def _splat_whole(builder: Any, scalar: Any) -> Any:
    first = builder.insert_element(whole(0), scalar, ir.Constant(I32, 0))
    return builder.shuffle_vector(first, whole(0), whole(0))


def _cell_of(builder: Any, weight: Any, cells: Any) -> tuple[Any, Any]:
    """Place along a side of a card, in cells, and the cell that it is in."""
    floor = _function(builder.module, ir.FunctionType(REALS, [REALS]), f"llvm.floor.v{LANES}f32")
    place = builder.fmul(weight, cells)
    below = larger_of(builder, builder.call(floor, [place]), constant(0.0))
    # Lanes of rays that met nothing hold anything.
    return place, smaller_of(builder, below, constant(255.0))


def _gaps(builder: Any, u: Any, v: Any, rows: Any, columns: Any, number: Any) -> Any:
    """Which of eight places on a card are in gaps."""
    add, sub, mul = builder.fadd, builder.fsub, builder.fmul
    one, half = constant(1.0), constant(0.5)
    (x, fx), (y, fy) = _cell_of(builder, u, rows), _cell_of(builder, v, columns)
    reach = add(mul(add(fx, one), columns), mul(add(fy, one), rows))
    cut = builder.fcmp_ordered(">", reach, add(mul(rows, columns), constant(0.01)))
    i, j = builder.fptosi(fx, _WHOLES), builder.fptosi(fy, _WHOLES)
    cell = builder.add(i, builder.mul(j, whole(16)))
    mixed = builder.add(builder.mul(cell, whole(374761393)), builder.mul(number, whole(668265263)))
    chance, turn = (
        hash_lanes(builder, builder.add(mixed, whole((SEED + k) * 2246822519))) for k in range(2)
    )
    bare = builder.fcmp_ordered("<", chance, constant(float(BARE)))
    turn = sub(mul(turn, constant(2.0)), one)
    square = mul(turn, turn)
    scale = builder.fdiv(one, add(one, square))
    cosine, sine = mul(sub(one, square), scale), mul(add(turn, turn), scale)
    aside = constant(float(ASIDE))
    x = sub(sub(sub(x, fx), half), mul(aside, turn))
    y = sub(sub(sub(y, fy), half), mul(aside, sub(add(chance, chance), one)))
    size = builder.fdiv(one, add(one, mul(constant(float(GROWTH)), chance)))
    along = mul(mul(add(mul(cosine, x), mul(sine, y)), size), constant(float(1 / LONG)))
    across = mul(mul(sub(mul(cosine, y), mul(sine, x)), size), constant(float(1 / WIDE)))
    beside = builder.fcmp_ordered(">", magnitude(builder, across), sub(one, mul(along, along)))
    return builder.or_(builder.or_(cut, bare), beside)


@_intrinsic
def on_leaves(typing_context, bits, found, cells, number):  # type: ignore[no-untyped-def]
    """Those of 64 rays that meet a leaf of a card, not a gap.

    Args:
        typing_context: numba's.
        bits: a bit for each ray that meets the card.
        found: ``(3, 64)`` float32 where, and the weights of the first and second corner.
        cells, number: as for :func:`carstage_sim.render.leaves.leaf_at`.

    Returns:
        int64, the bits that are left.
    """
    signature = types.int64(bits, found, cells, number)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        rays, data, card, triangle = unpack(context, builder, signature, args)
        sides = (builder.and_(card, ir.Constant(I64, 15)), builder.lshr(card, ir.Constant(I64, 4)))
        rows, columns = (splat(builder, builder.sitofp(side, F32)) for side in sides)
        numbers = _splat_whole(builder, builder.trunc(triangle, I32))
        nothing, eight = ir.Constant(I64, 0), ir.Constant(I64, LANES)
        left, met = new_variable(builder, rays), new_variable(builder, rays)
        check, body, end = (
            builder.append_basic_block(name) for name in ("cards", "card", "cards_end")
        )
        builder.branch(check)
        builder.position_at_end(check)
        value = builder.load(left)
        builder.cbranch(builder.icmp_unsigned("!=", value, nothing), body, end)
        builder.position_at_end(body)
        row = builder.udiv(builder.cttz(value, cgutils.true_bit), eight)
        u, v = (
            load_lanes(builder, data, builder.add(row, ir.Constant(I64, k * _ROWS))) for k in (1, 2)
        )
        shift = builder.mul(row, eight)
        gaps = bits_of(builder, _gaps(builder, u, v, rows, columns, numbers))
        builder.store(builder.and_(builder.load(met), builder.not_(builder.shl(gaps, shift))), met)
        looked_at = builder.shl(ir.Constant(I64, (1 << LANES) - 1), shift)
        builder.store(builder.and_(value, builder.not_(looked_at)), left)
        builder.branch(check)
        builder.position_at_end(end)
        return builder.load(met)

    return signature, codegen
