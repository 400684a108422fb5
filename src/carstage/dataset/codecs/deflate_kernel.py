"""The loops of our deflate, compiled; see ``deflate_runs``.

Nothing here calls another file, whose changes numba would not notice when it looks for machine code
that it kept.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numba
import numpy as np
from numpy.typing import NDArray

_END: Final = 256
_SYMBOLS: Final = 286
_LONGEST_CODE: Final = 15
WORD_BYTES: Final = 8
BLOCK_WORDS: Final = 1 << 14
"""Words with one set of codes: few enough to follow the picture, enough to pay for the codes."""
_RUN_WORDS: Final = 32


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


def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile at the first call, and keep the machine code where that can be done."""
    try:
        kept: Callable[..., Any] = numba.njit(cache=True)(function)
    except RuntimeError:  # neither this folder nor the user's cache can be written
        kept = numba.njit(function)
    return kept


@_compiled
def _code_lengths(counts: Any, lengths: Any) -> None:
    """Huffman's lengths of at most 15 bits; 0 for symbols that do not occur.

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


@_compiled
def _canonical(lengths: Any, codes: Any) -> None:
    """Codes by length and symbol, their bits turned round, with the length << 16 above them."""
    code = 0
    for length in range(1, _LONGEST_CODE + 1):
        for symbol in range(_SYMBOLS):
            if lengths[symbol] == length:
                turned = 0
                for bit in range(length):
                    turned |= (code >> bit & 1) << (length - 1 - bit)
                codes[symbol] = turned | length << 16
                code += 1
        code <<= 1


@_compiled
def encode(words: Any, rest: Any, out: Any, runs: Any) -> int:
    """Write all blocks to words of 32 bits; the number of bytes.

    Args:
        words: the data as uint64, little-endian.
        rest: the bytes after the last whole word.
        out: uint32.
        runs: see ``_run_table``.
    """
    ones, low, high = np.uint64(0x0101010101010101), np.uint64(0xFFFFFFFF), np.uint64(32)
    byte_mask, eight, top = np.uint64(0xFF), np.uint64(8), np.uint64(56)
    code_mask, sixteen, one = np.uint64(0xFFFF), np.uint64(16), np.uint64(1)
    counts = np.empty(_SYMBOLS, np.int64)
    lengths = np.empty(_SYMBOLS, np.int64)
    codes = np.zeros(_SYMBOLS, np.uint64)
    at, held, bits = 0, np.uint64(0), np.uint64(0)
    begin, size = 0, words.size
    while True:
        end = min(begin + BLOCK_WORDS, size)
        last = end == size
        counts[:] = 0
        counts[_END] = 1
        before = ~words[begin] if begin < end else np.uint64(0)  # no run begins a block
        run = 0
        for place in range(begin, end):
            word = words[place]
            if word == before:
                run += 1
                if run == _RUN_WORDS:
                    counts[runs[run] & 0xFFFF] += 1
                    run = 0
                continue
            if run > 0:
                counts[runs[run] & 0xFFFF] += 1
                run = 0
            before = (word >> top) * ones
            for _ in range(8):
                counts[np.intp(word & byte_mask)] += 1
                word >>= eight
        if run > 0:
            counts[runs[run] & 0xFFFF] += 1
        if last:
            for byte in rest:
                counts[byte] += 1
        _code_lengths(counts, lengths)
        _canonical(lengths, codes)

        # The head: last block or not, dynamic codes, 286 symbols, one distance, 19 lengths of
        # lengths, of which those of 0 to 15 are 4 and so make plain numbers of the lengths.
        held |= np.uint64((1 if last else 0) | 2 << 1 | 29 << 3 | 15 << 13) << bits
        bits += np.uint64(17)
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
            bits += np.uint64(width)
            if bits >= high:
                out[at] = held & low
                at += 1
                held >>= high
                bits -= high

        before = ~words[begin] if begin < end else np.uint64(0)
        run = 0
        # One place more than there are words, for the run that ends with them.
        for place in range(begin, end + 1):
            same = place < end and words[place] == before
            if same:
                run += 1
            if run > 0 and (not same or run == _RUN_WORDS):
                entry = runs[run]
                code = codes[entry & 0xFFFF]
                held |= (code & code_mask) << bits
                bits += code >> sixteen
                held |= np.uint64(entry >> 24) << bits
                # And the bit of the distance, a zero.
                bits += np.uint64(entry >> 16 & 0xFF) + one
                run = 0
                if bits >= high:
                    out[at] = held & low
                    at += 1
                    held >>= high
                    bits -= high
            if same or place == end:
                continue
            word = words[place]
            before = (word >> top) * ones
            for _ in range(4):
                code = codes[np.intp(word & byte_mask)]
                held |= (code & code_mask) << bits
                bits += code >> sixteen
                word >>= eight
                code = codes[np.intp(word & byte_mask)]
                held |= (code & code_mask) << bits
                bits += code >> sixteen
                word >>= eight
                # Written always, kept when full: when that happens cannot be foreseen.
                out[at] = held & low
                full = bits >> np.uint64(5)
                at += int(full)
                held >>= full << np.uint64(5)
                bits -= full << np.uint64(5)
        if last:
            for byte in rest:
                code = codes[byte]
                held |= (code & code_mask) << bits
                bits += code >> sixteen
                if bits >= high:
                    out[at] = held & low
                    at += 1
                    held >>= high
                    bits -= high
        code = codes[_END]
        held |= (code & code_mask) << bits
        bits += code >> sixteen
        if bits >= high:
            out[at] = held & low
            at += 1
            held >>= high
            bits -= high
        if last:
            break
        begin = end
    out[at] = held & low
    return 4 * at + int(bits + np.uint64(7)) // 8
