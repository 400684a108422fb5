"""The loops of our deflate, compiled; see ``deflate_runs``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from carstage.kernels import compiled

_END: Final = 256
_SYMBOLS: Final = 286
_LONGEST_CODE: Final = 14
"""One less than allowed: four codes and the seven bits before them fit into 64."""
WORD_BYTES: Final = 8
BLOCK_WORDS: Final = 1 << 14
"""Words with one set of codes: few enough to follow the picture, enough to pay for the codes."""
_RUN_WORDS: Final = 32

_struct_of: Any = cgutils.create_struct_proxy
_intrinsic: Callable[[Callable[..., Any]], Callable[..., Any]] = intrinsic
_ONES: Final = np.uint64(0x0101010101010101)
_BYTE: Final = np.uint64(0xFF)
_LENGTH: Final = np.uint64(63)
"""Of an entry of codes; what a processor takes of a shift's width, and so costs nothing."""
_WHOLE_BYTES: Final = np.uint64(0x78)
_THREE: Final = np.uint64(3)
_EIGHT: Final = np.uint64(8)
_SIXTEEN: Final = np.uint64(16)
_TWENTY_FOUR: Final = np.uint64(24)
_THIRTY_TWO: Final = np.uint64(32)
_TOP: Final = np.uint64(56)


def _run_table() -> NDArray[np.uint32]:
    """For runs of 0 to 32 words: symbol, extra bits << 16, their value << 24 (RFC 1951, 3.2.5)."""
    table = np.zeros(_RUN_WORDS + 1, np.uint32)
    length, symbol = 3, 257
    while length <= _RUN_WORDS * WORD_BYTES:
        bits = max(0, (symbol - 261) // 4)
        for value in range(1 << bits):
            words, odd = divmod(length + value, WORD_BYTES)
            if not odd and words <= _RUN_WORDS:
                table[words] = symbol | bits << 16 | value << 24
        length += 1 << bits
        symbol += 1
    return table


RUNS: Final = _run_table()
"""For :func:`encode`."""


@compiled
def _code_lengths(counts: Any, lengths: Any) -> None:
    """Huffman's lengths of at most ``_LONGEST_CODE`` bits; 0 for symbols that do not occur.

    Two queues: the leaves by count, and the inner nodes, which are made in the order of theirs.
    Where a code is too long, counts are made more alike until none is.
    """
    while True:
        order = np.argsort(counts, kind="mergesort")
        order = order[counts[order] > 0]
        leaves = order.size
        weight = np.zeros(2 * leaves, np.int64)
        parent = np.zeros(2 * leaves, np.int64)
        weight[:leaves] = counts[order]
        leaf, inner = 0, leaves
        for node in range(leaves, 2 * leaves - 1):
            for _ in range(2):
                if leaf < leaves and (inner >= node or weight[leaf] <= weight[inner]):
                    child = leaf
                    leaf += 1
                else:
                    child = inner
                    inner += 1
                weight[node] += weight[child]
                parent[child] = node
        depth = np.zeros(2 * leaves, np.int64)
        for node in range(2 * leaves - 3, -1, -1):
            depth[node] = depth[parent[node]] + 1
        if depth[:leaves].max() <= _LONGEST_CODE:
            break
        for symbol in range(_SYMBOLS):
            counts[symbol] = (counts[symbol] + 1) // 2
    lengths[:] = 0
    for place in range(leaves):
        lengths[order[place]] = depth[place]


@compiled
def _canonical(lengths: Any, codes: Any) -> None:
    """Codes by length and symbol: the length, and << 8 the code with its bits turned round."""
    code = 0
    for length in range(1, _LONGEST_CODE + 1):
        for symbol in range(_SYMBOLS):
            if lengths[symbol] == length:
                turned = 0
                for bit in range(length):
                    turned |= (code >> bit & 1) << (length - 1 - bit)
                codes[symbol] = turned << 8 | length
                code += 1
        code <<= 1


@_intrinsic
def _put(_: Any, out: Any, at: Any, held: Any) -> Any:
    """Write eight bytes, little-endian, at any place of uint8."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = signature.args[0]
        data = _struct_of(kind)(context, builder, value=arguments[0]).data
        place = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(64).as_pointer())
        builder.store(arguments[2], place, align=1)
        return context.get_dummy_value()

    return types.void(out, types.intp, types.uint64), generate


@compiled
def _flushed(out: Any, at: int, held: Any, bits: Any) -> tuple[int, Any, Any]:
    """Write what is held, keep what is not a whole byte: place, bits and number of those kept.

    It is written always, and overwritten where it was not whole: when that happens cannot be
    foreseen.
    """
    _put(out, at, held)
    whole = bits & _WHOLE_BYTES
    return at + int(bits >> _THREE), held >> whole, bits - whole


@compiled
def _count(words: Any, begin: int, end: int, runs: Any, counts: Any) -> None:
    """Add how often each symbol occurs in the words of a block, ``(4, _SYMBOLS)``.

    Four rows, as equal bytes often come together, and each has to wait for the count of the last.
    """
    before = ~words[begin] if begin < end else np.uint64(0)  # no run begins a block
    run = 0
    for place in range(begin, end):
        word = words[place]
        if word == before:
            run += 1
            if run == _RUN_WORDS:
                counts[0, runs[run] & 0xFFFF] += 1
                run = 0
            continue
        if run > 0:
            counts[0, runs[run] & 0xFFFF] += 1
            run = 0
        before = (word >> _TOP) * _ONES
        for _ in range(2):
            for row in range(4):
                counts[row, np.intp(word & _BYTE)] += 1
                word >>= _EIGHT
    if run > 0:
        counts[0, runs[run] & 0xFFFF] += 1


@compiled
def _head(
    last: bool, lengths: Any, out: Any, at: int, held: Any, bits: Any
) -> tuple[int, Any, Any]:
    """The head of a block with codes of its own: 286 symbols, one distance.

    Of the 19 lengths of lengths those of 0 to 15 are 4, and so make plain numbers of the lengths.
    """
    held |= np.uint64((1 if last else 0) | 2 << 1 | 29 << 3 | 15 << 13) << bits
    at, held, bits = _flushed(out, at, held, bits + np.uint64(17))
    for number in range(19 + _SYMBOLS + 1):
        if number < 19:
            value, width = (0 if number < 3 else 4), 3
        elif number < 19 + _SYMBOLS:
            plain = lengths[number - 19]
            value = (plain & 1) << 3 | (plain & 2) << 1 | (plain & 4) >> 1 | (plain & 8) >> 3
            width = 4
        else:
            value, width = 8, 4  # the only distance has a code of one bit
        held |= np.uint64(value) << bits
        at, held, bits = _flushed(out, at, held, bits + np.uint64(width))
    return at, held, bits


@compiled
def _literals(
    words: Any,
    place: int,
    end: int,
    before: Any,
    codes: Any,
    out: Any,
    at: int,
    held: Any,
    bits: Any,
) -> tuple[int, Any, int, Any, Any]:
    """Write words one by one up to the end of the block, or to one that begins a run."""
    while place < end:
        word = words[place]
        if word == before:
            break
        before = (word >> _TOP) * _ONES
        for _ in range(2):
            # Four codes become one before they meet what is held, which has to be waited for.
            a = codes[np.intp(word & _BYTE)]
            b = codes[np.intp(word >> _EIGHT & _BYTE)]
            c = codes[np.intp(word >> _SIXTEEN & _BYTE)]
            d = codes[np.intp(word >> _TWENTY_FOUR & _BYTE)]
            word >>= _THIRTY_TWO
            ab = a >> _EIGHT | (b >> _EIGHT) << (a & _LENGTH)
            cd = c >> _EIGHT | (d >> _EIGHT) << (c & _LENGTH)
            held |= (ab | cd << (a + b & _LENGTH)) << bits
            at, held, bits = _flushed(out, at, held, bits + (a + b + c + d & _LENGTH))
        place += 1
    return place, before, at, held, bits


@compiled
def encode(words: Any, rest: Any, out: Any, runs: Any) -> int:
    """Write all blocks; the number of bytes.

    Args:
        words: the data as uint64, little-endian.
        rest: the bytes after the last whole word.
        out: uint8, with eight bytes more than are needed.
        runs: see ``_run_table``.
    """
    lengths = np.empty(_SYMBOLS, np.int64)
    codes = np.zeros(_SYMBOLS, np.uint64)
    at, held, bits = 0, np.uint64(0), np.uint64(0)
    begin, size = 0, words.size
    while True:
        end = min(begin + BLOCK_WORDS, size)
        last = end == size
        counts = np.zeros((4, _SYMBOLS), np.int64)
        counts[0, _END] = 1
        _count(words, begin, end, runs, counts)
        if last:
            for byte in rest:
                counts[0, byte] += 1
        _code_lengths(counts.sum(0), lengths)
        _canonical(lengths, codes)
        at, held, bits = _head(last, lengths, out, at, held, bits)

        before = ~words[begin] if begin < end else np.uint64(0)
        place = begin
        while place < end:
            place, before, at, held, bits = _literals(
                words, place, end, before, codes, out, at, held, bits
            )
            while place < end and words[place] == before:
                run = 1
                while run < _RUN_WORDS and place + run < end and words[place + run] == before:
                    run += 1
                place += run
                entry = runs[run]
                code = codes[entry & 0xFFFF]
                held |= (code >> _EIGHT) << bits
                bits += code & _LENGTH
                held |= np.uint64(entry >> 24) << bits
                # And the bit of the distance, a zero.
                at, held, bits = _flushed(out, at, held, bits + np.uint64((entry >> 16 & 0xFF) + 1))
        if last:
            for byte in rest:
                code = codes[byte]
                held |= (code >> _EIGHT) << bits
                at, held, bits = _flushed(out, at, held, bits + (code & _LENGTH))
        code = codes[_END]
        held |= (code >> _EIGHT) << bits
        at, held, bits = _flushed(out, at, held, bits + (code & _LENGTH))
        if last:
            break
        begin = end
    _put(out, at, held)
    end_of_all: int = at + int(bits > np.uint64(0))
    return end_of_all
