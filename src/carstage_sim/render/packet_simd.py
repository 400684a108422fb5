"""What tests of a packet's rays are made of, written as LLVM vector code.

Rays of a packet begin at one place (:mod:`carstage_sim.render.beam_simd`) or run in one direction
(:mod:`carstage_sim.render.shaft_simd`). Boxes and triangles that none of them meets are told eight
at a time; a triangle is then tested with eight rays at once, by the operations of
:mod:`carstage_sim.render.simd`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from carstage_sim.kernels import Decorator
from carstage_sim.render.vector_code import (
    I32,
    I64,
    LANES,
    REALS,
    constant,
    larger_of,
    load_lanes,
    new_variable,
    smaller_of,
    splat,
    unpack,
)

PACKET = 64
"""Rays that are traced together."""
EDGES = ((0, 1), (1, 2), (2, 0))
EDGE_SLACK = 1e-5
"""Share of two corners' distances, multiplied, that allows for the rounding of an edge's side."""

_intrinsic: Decorator = intrinsic


def magnitude(builder: Any, value: Any) -> Any:
    """Numbers without their signs."""
    kind = ir.VectorType(I32, LANES)
    mask = ir.Constant(kind, [0x7FFFFFFF] * LANES)
    return builder.bitcast(builder.and_(builder.bitcast(value, kind), mask), REALS)


def dot(builder: Any, vector: Any, point: Any) -> Any:
    """Product of a direction, eight times the same, and eight points."""
    x, y, z = (builder.fmul(a, b) for a, b in zip(vector, point, strict=True))
    return builder.fadd(builder.fadd(x, y), z)


def minor(builder: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """``a * b - c * d``."""
    return builder.fsub(builder.fmul(a, b), builder.fmul(c, d))


def reach_of(builder: Any, low: list[Any], high: list[Any]) -> Any:
    """Sum of the largest coordinates of eight boxes' corners."""
    total = None
    for one, other in zip(low, high, strict=True):
        part = larger_of(builder, magnitude(builder, one), magnitude(builder, other))
        total = part if total is None else builder.fadd(total, part)
    return total


def span_of(builder: Any, normal: list[Any], low: list[Any], high: list[Any]) -> tuple[Any, Any]:
    """Least and largest place of eight boxes along a direction."""
    least, most = None, None
    for factor, one, other in zip(normal, low, high, strict=True):
        a, b = builder.fmul(factor, one), builder.fmul(factor, other)
        lower, upper = smaller_of(builder, a, b), larger_of(builder, a, b)
        least = lower if least is None else builder.fadd(least, lower)
        most = upper if most is None else builder.fadd(most, upper)
    return least, most


def corner_of(builder: Any, data: Any, first: Any, axis: Any, corner: int) -> Any:
    """A coordinate of a triangle's corner; ``first`` is where the triangle's lane begins."""
    row = builder.add(axis, ir.Constant(I64, 3 * corner))
    place = builder.add(first, builder.mul(row, ir.Constant(I64, LANES)))
    return builder.load(builder.gep(data, [place]))


def number_at(builder: Any, array: Any, place: Any) -> Any:
    """Address of a number of a float32 array."""
    return builder.gep(array, [ir.Constant(I64, place) if isinstance(place, int) else place])


def numbers_at(builder: Any, array: Any, places: range) -> list[Any]:
    """Numbers of a float32 array, each eight times."""
    return [
        splat(builder, builder.load(builder.gep(array, [ir.Constant(I64, place)])))
        for place in places
    ]


def overlapping(builder: Any, spans: list[tuple[Any, Any]], bounds: list[Any]) -> Any:
    """Where all intervals meet theirs of ``bounds``: least, largest, least, largest, ..."""
    met = None
    for k, (low, high) in enumerate(spans):
        both = builder.and_(
            builder.fcmp_ordered("<=", low, bounds[2 * k + 1]),
            builder.fcmp_ordered(">=", high, bounds[2 * k]),
        )
        met = both if met is None else builder.and_(met, both)
    return met


def across_lanes(builder: Any, vector: Any, join: Callable[[Any, Any, Any], Any]) -> Any:
    """One number of eight: halves are joined until one is left."""
    undefined = ir.Constant(REALS, ir.Undefined)
    for half in (4, 2, 1):
        order = [k + half if k + half < LANES else k for k in range(LANES)]
        mask = ir.Constant(ir.VectorType(I32, LANES), order)
        vector = join(builder, vector, builder.shuffle_vector(vector, undefined, mask))
    return builder.extract_element(vector, ir.Constant(I32, 0))


def in_rows(builder: Any, rows: Any, meet_row: Callable[[Any], Any]) -> Any:
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


def rows_of_found(builder: Any, row: Any) -> list[Any]:
    """Where parameters and weights of eight of 64 rays belong."""
    return [builder.add(row, ir.Constant(I64, k * PACKET // LANES)) for k in range(3)]


def reaches_inside(builder: Any, edges: list[Any], bounds: list[Any]) -> Any:
    """Whether some place within bounds may be on the same side of all three edges.

    Each edge: factors of the place's two coordinates, what is added, room for rounding.
    """
    leftmost, rightmost = None, None
    for normal, offset, slack in edges:
        least, most = span_of(builder, normal, [bounds[0], bounds[2]], [bounds[1], bounds[3]])
        most = builder.fadd(builder.fadd(most, offset), slack)
        least = builder.fsub(builder.fadd(least, offset), slack)
        leftmost = most if leftmost is None else smaller_of(builder, leftmost, most)
        rightmost = least if rightmost is None else larger_of(builder, rightmost, least)
    zero = constant(0.0)
    return builder.or_(
        builder.fcmp_unordered(">=", leftmost, zero), builder.fcmp_unordered("<=", rightmost, zero)
    )


def rows_between(
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
def largest(typing_context, numbers, begin, groups):  # type: ignore[no-untyped-def]
    """Largest of ``8 * groups`` float32 numbers from number ``8 * begin`` on."""
    signature = types.float32(numbers, begin, groups)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, first, count = unpack(context, builder, signature, args)
        most = new_variable(builder, load_lanes(builder, data, first))
        with cgutils.for_range(builder, count) as loop:
            value = load_lanes(builder, data, builder.add(first, loop.index))
            builder.store(larger_of(builder, builder.load(most), value), most)
        return across_lanes(builder, builder.load(most), larger_of)

    return signature, codegen
