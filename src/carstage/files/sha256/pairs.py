"""SHA-256 of two contents side by side, by the processor's instructions for it.

Each of these instructions waits for the one before, so the second content is hashed while the first
one waits. They are compiled with LLVM alone, which is loaded in a fifth of numba's time.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numpy as np
from llvmlite import binding, ir

from carstage.files.sha256.standard import BLOCK_BYTES, H0, ROUNDS, K, address, last_blocks

_I32: Final = ir.IntType(32)
_I64: Final = ir.IntType(64)
_BYTES: Final = ir.IntType(8).as_pointer()
_FOUR: Final = ir.VectorType(_I32, 4)
_WORD_BYTES: Final = 4
_STATE_WORDS: Final = 8
# Places of words in the two vectors of a state, as the instructions want them, and back again.
_FEBA: Final = (5, 4, 1, 0)
_HGDC: Final = (7, 6, 3, 2)
_ABCD: Final = (3, 2, 7, 6)
_EFGH: Final = (1, 0, 5, 4)


def pair_digests(first: bytes | memoryview, second: bytes | memoryview) -> tuple[bytes, bytes]:
    """The digests of two contents; nothing is gained beyond the length of the shorter one."""
    kernels = _kernels()
    contents = (first, second)
    states = np.stack([H0, H0])
    blocks = [len(content) // BLOCK_BYTES for content in contents]
    both = min(blocks)
    kernels.two(states.ctypes.data, address(first), address(second), both)
    for state, content, count in zip(states, contents, blocks, strict=True):
        rest = address(content) + BLOCK_BYTES * both
        kernels.one(state.ctypes.data, rest, count - both)
        end = last_blocks(content)
        kernels.one(state.ctypes.data, address(end), len(end) // BLOCK_BYTES)
    ours, other = (state.astype(">u4").tobytes() for state in states)
    return ours, other


def load() -> None:
    """Compile what ``pair_digests`` needs; its first call would."""
    _kernels()


class _Kernels:
    """Machine code that takes blocks into states: of one content, and of two.

    Both take the address of the states, ``(1, 8)`` or ``(2, 8)`` uint32, those of the contents, and
    the number of blocks. Other Python threads go on meanwhile.
    """

    def __init__(self) -> None:
        module = ir.Module()
        for contents in (1, 2):
            _define(module, contents)
        binding.initialize_native_target()
        binding.initialize_native_asmprinter()
        target = binding.Target.from_default_triple().create_target_machine(
            cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten()
        )
        self._engine = binding.create_mcjit_compiler(binding.parse_assembly(str(module)), target)
        self._engine.finalize_object()
        self.one = self._function(1)
        self.two = self._function(2)

    def _function(self, contents: int) -> Callable[..., None]:
        pointers = [ctypes.c_void_p] * (1 + contents)
        kind = ctypes.CFUNCTYPE(None, *pointers, ctypes.c_uint64)
        function: Callable[..., None] = kind(self._engine.get_function_address(_name(contents)))
        return function


@cache
def _kernels() -> _Kernels:
    return _Kernels()


def _name(contents: int) -> str:
    return f"blocks_of_{contents}"


def _define(module: Any, contents: int) -> None:
    """A function of the states' address, each content's, and the number of blocks."""
    kind = ir.FunctionType(ir.VoidType(), [_BYTES] * (1 + contents) + [_I64])
    function = ir.Function(module, kind, _name(contents))
    states, *places, count = function.args
    entry, body, end = (function.append_basic_block(name) for name in ("entry", "block", "end"))

    builder = ir.IRBuilder(entry)
    before = []
    for content in range(contents):
        abcd, efgh = (
            builder.load(_words_at(builder, states, _STATE_WORDS * content + word), align=1)
            for word in (0, 4)
        )
        before += [_shuffled(builder, abcd, efgh, order) for order in (_FEBA, _HGDC)]
    builder.cbranch(builder.icmp_unsigned(">", count, _I64(0)), body, end)

    builder.position_at_end(body)
    block = builder.phi(_I64)
    state = [builder.phi(_FOUR) for _ in before]
    offset = builder.mul(block, _I64(BLOCK_BYTES))
    messages = [_message(builder, builder.gep(place, [offset])) for place in places]
    after = _hashed(builder, state, messages)
    following = builder.add(block, _I64(1))
    builder.cbranch(builder.icmp_unsigned("<", following, count), body, end)
    for phi, first, later in zip(
        [block, *state], [_I64(0), *before], [following, *after], strict=True
    ):
        phi.add_incoming(first, entry)
        phi.add_incoming(later, body)

    builder.position_at_end(end)
    result = [builder.phi(_FOUR) for _ in before]
    for phi, first, later in zip(result, before, after, strict=True):
        phi.add_incoming(first, entry)
        phi.add_incoming(later, body)
    for content in range(contents):
        feba, hgdc = result[2 * content : 2 * content + 2]
        for word, order in ((0, _ABCD), (4, _EFGH)):
            place = _words_at(builder, states, _STATE_WORDS * content + word)
            builder.store(_shuffled(builder, feba, hgdc, order), place, align=1)
    builder.ret_void()


def _words_at(builder: Any, place: Any, word: int) -> Any:
    """Where four words lie behind a place."""
    there = builder.gep(place, [_I64(_WORD_BYTES * word)])
    return builder.bitcast(there, _FOUR.as_pointer())


def _shuffled(builder: Any, a: Any, b: Any, order: tuple[int, ...]) -> Any:
    return builder.shuffle_vector(a, b, ir.Constant(_FOUR, list(order)))


def _called(builder: Any, name: str, *arguments: Any) -> Any:
    """One of LLVM's own functions, of vectors of four words."""
    found = builder.module.globals.get(name)
    kind = ir.FunctionType(_FOUR, [_FOUR] * len(arguments))
    return builder.call(found or ir.Function(builder.module, kind, name), arguments)


def _message(builder: Any, place: Any) -> list[Any]:
    """The sixteen words of a block, in four vectors."""
    return [
        _called(builder, "llvm.bswap.v4i32", builder.load(_words_at(builder, place, word), align=1))
        for word in range(0, 16, 4)
    ]


def _hashed(builder: Any, before: list[Any], messages: list[list[Any]]) -> list[Any]:
    """The states after one block of each content (6.2.2), four rounds of each in turn."""
    state = list(before)
    for first in range(0, ROUNDS, 4):
        for content, message in enumerate(messages):
            if first >= 16:
                message.append(_following(builder, *message))
                del message[0]
            words = message[3] if first >= 16 else message[first // 4]
            words = builder.add(words, ir.Constant(_FOUR, K[first : first + 4]))
            feba, hgdc = state[2 * content : 2 * content + 2]
            hgdc = _called(builder, "llvm.x86.sha256rnds2", hgdc, feba, words)
            words = _shuffled(builder, words, words, (2, 3, 2, 3))
            feba = _called(builder, "llvm.x86.sha256rnds2", feba, hgdc, words)
            state[2 * content : 2 * content + 2] = feba, hgdc
    return [builder.add(old, new) for old, new in zip(before, state, strict=True)]


def _following(builder: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """The four words of the message schedule behind the last sixteen."""
    begun = _called(builder, "llvm.x86.sha256msg1", a, b)
    begun = builder.add(begun, _shuffled(builder, c, d, (1, 2, 3, 4)))
    return _called(builder, "llvm.x86.sha256msg2", begun, d)
