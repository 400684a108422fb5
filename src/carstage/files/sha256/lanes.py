"""SHA-256 in sixteen lanes, written as LLVM vector code.

numba has no vector types. LLVM splits the vectors on processors with narrower registers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from carstage.files.sha256.standard import BLOCK_BYTES, H0, ROUNDS, K, address, last_blocks
from carstage.kernels import compiled

LANES: Final = 16

_struct_of: Any = cgutils.create_struct_proxy
_llvm_function: Any = cgutils.get_or_insert_function
_intrinsic: Callable[[Callable[..., Any]], Callable[..., Any]] = intrinsic
_I32: Final = ir.IntType(32)
_LANE: Final = ir.VectorType(_I32, LANES)


def lane_digests(contents: Sequence[bytes | memoryview]) -> list[bytes]:
    """The digests of at most sixteen contents, the longest first.

    Raises:
        ValueError: more contents than lanes, or in another order.
    """
    lengths = [len(content) for content in contents]
    if len(contents) > LANES or lengths != sorted(lengths, reverse=True):
        raise ValueError("at most sixteen contents are hashed at once, the longest first")
    state = np.repeat(H0[:, None], LANES, axis=1)
    places = np.zeros(LANES, np.uint64)
    # Lanes without a content, and those that are done, repeat what the first one does.
    places[:] = address(contents[0])
    places[: len(contents)] = [address(content) for content in contents]
    done = 0
    before_tail: list[NDArray[np.uint32]] = [state[:, 0]] * len(contents)
    for lane in range(len(contents) - 1, -1, -1):
        blocks = lengths[lane] // BLOCK_BYTES
        _compress(state, places, done, blocks)
        done = blocks
        before_tail[lane] = state[:, lane].copy()
        places[lane] = places[0]
    return _tails(contents, before_tail)


def _tails(contents: Sequence[bytes | memoryview], before: list[NDArray[np.uint32]]) -> list[bytes]:
    """Digests from the states before each content's last, padded block or two (5.1.1)."""
    tails = np.zeros((LANES, 2 * BLOCK_BYTES), np.uint8)
    blocks = []
    for tail, content in zip(tails, contents, strict=False):
        end = last_blocks(content)
        tail[: len(end)] = np.frombuffer(end, np.uint8)
        blocks.append(len(end) // BLOCK_BYTES)
    state = np.repeat(H0[:, None], LANES, axis=1)
    state[:, : len(before)] = np.stack(before, axis=1)
    places = tails.ctypes.data + np.arange(LANES, dtype=np.uint64) * np.uint64(tails.shape[1])
    _compress(state, places, 0, 1)
    short = state.copy()
    _compress(state, places, 1, 2)
    return [
        (short if count == 1 else state)[:, lane].astype(">u4").tobytes()
        for lane, count in enumerate(blocks)
    ]


def _all_lanes(value: int) -> Any:
    return ir.Constant(_LANE, [value] * LANES)


def _transposed(builder: Any, rows: list[Any]) -> list[Any]:
    """Sixteen vectors of sixteen words, rows made columns."""
    distance = 1
    while distance < LANES:
        near = [k if not k & distance else LANES + (k ^ distance) for k in range(LANES)]
        far = [k | distance if not k & distance else LANES + k for k in range(LANES)]
        for i in range(LANES):
            if not i & distance:
                a, b = rows[i], rows[i | distance]
                rows[i] = builder.shuffle_vector(a, b, ir.Constant(_LANE, near))
                rows[i | distance] = builder.shuffle_vector(a, b, ir.Constant(_LANE, far))
        distance *= 2
    return rows


def _words(builder: Any, places: Any, offset: Any) -> list[Any]:
    """A block of each lane: its words one to sixteen, each a vector over the lanes."""
    swap = _llvm_function(
        builder.module, ir.FunctionType(_LANE, [_LANE]), f"llvm.bswap.v{LANES}i32"
    )
    rows = []
    for lane in range(LANES):
        address = builder.load(builder.gep(places, [ir.Constant(_I32, lane)]))
        block = builder.inttoptr(builder.add(address, offset), _LANE.as_pointer())
        rows.append(builder.load(block, align=1))
    return [builder.call(swap, [row]) for row in _transposed(builder, rows)]


def _hashed(builder: Any, state: list[Any], words: list[Any]) -> list[Any]:
    """The state after one block (6.2.2)."""
    shift = _llvm_function(
        builder.module, ir.FunctionType(_LANE, [_LANE] * 3), f"llvm.fshr.v{LANES}i32"
    )
    add, and_, or_, shr = builder.add, builder.and_, builder.or_, builder.lshr

    def xor(x: Any, y: Any, z: Any) -> Any:
        return builder.xor(builder.xor(x, y), z)

    def rotated(x: Any, bits: int) -> Any:
        return builder.call(shift, [x, x, _all_lanes(bits)])

    a, b, c, d, e, f, g, h = state
    w = list(words)
    for t in range(ROUNDS):
        now = t % 16
        if t >= 16:
            x, y = w[(t - 15) % 16], w[(t - 2) % 16]
            small0 = xor(rotated(x, 7), rotated(x, 18), shr(x, _all_lanes(3)))
            small1 = xor(rotated(y, 17), rotated(y, 19), shr(y, _all_lanes(10)))
            w[now] = add(add(w[now], small0), add(w[(t - 7) % 16], small1))
        sum1 = xor(rotated(e, 6), rotated(e, 11), rotated(e, 25))
        choice = builder.xor(g, and_(e, builder.xor(f, g)))
        t1 = add(add(add(h, add(w[now], _all_lanes(K[t]))), choice), sum1)
        sum0 = xor(rotated(a, 2), rotated(a, 13), rotated(a, 22))
        majority = or_(and_(a, b), and_(c, or_(a, b)))
        a, b, c, d, e, f, g, h = add(add(sum0, majority), t1), a, b, c, add(d, t1), e, f, g
    return [add(old, new) for old, new in zip(state, (a, b, c, d, e, f, g, h), strict=True)]


@_intrinsic
def _one_block(_: Any, state: Any, places: Any, offset: Any) -> Any:
    """Take the block ``offset`` bytes behind each lane's place into ``state``, ``(8, LANES)``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        arrays = [
            _struct_of(kind)(context, builder, value=value)
            for kind, value in zip(signature.args[:2], arguments[:2], strict=True)
        ]
        rows = builder.bitcast(arrays[0].data, _LANE.as_pointer())
        pointers = [builder.gep(rows, [ir.Constant(_I32, row)]) for row in range(8)]
        before = [builder.load(pointer, align=4) for pointer in pointers]
        words = _words(builder, arrays[1].data, arguments[2])
        for pointer, after in zip(pointers, _hashed(builder, before, words), strict=True):
            builder.store(after, pointer, align=4)
        return context.get_dummy_value()

    return types.void(state, places, offset), generate


@compiled
def _compress(state: Any, places: Any, first: int, end: int) -> None:
    """Take blocks ``first`` to ``end`` behind each lane's place into the states."""
    for block in range(first, end):
        _one_block(state, places, np.uint64(BLOCK_BYTES * block))
