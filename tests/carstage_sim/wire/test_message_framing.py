"""Messages are cut out of any stream; what goes beyond the limits is refused at its header."""

from __future__ import annotations

import struct
import tracemalloc

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from carstage_sim.wire.errors import MessageError
from carstage_sim.wire.framing import DEEPEST, MOST_BYTES, MOST_ITEMS, MessageSplitter

_LEAVES = (
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text()
    | st.binary(max_size=3_000)
    | st.builds(msgpack.ExtType, st.integers(0, 127), st.binary(max_size=300))
)
VALUES = st.recursive(
    _LEAVES,
    lambda inner: (
        st.lists(inner, max_size=20) | st.dictionaries(st.text(max_size=5), inner, max_size=20)
    ),
    max_leaves=30,
)


@settings(max_examples=80, deadline=None)
@given(st.lists(VALUES, max_size=5), st.integers(1, 50_000))
def test_messages_come_out_whole_however_they_are_cut(values: list[object], piece: int) -> None:
    packed = [msgpack.packb(value) for value in values]
    stream = b"".join(packed)
    splitter = MessageSplitter()
    found: list[bytes] = []
    for begin in range(0, len(stream), piece):
        splitter.feed(stream[begin : begin + piece])
        found.extend(splitter.messages())
    assert found == packed
    assert splitter.unfinished_bytes == 0


def test_every_kind_of_header_is_understood_byte_by_byte() -> None:
    kinds = [
        *(struct.pack(">BB", 0xC4, 3) + b"abc", struct.pack(">BH", 0xC5, 3) + b"abc"),
        struct.pack(">BI", 0xC6, 3) + b"abc",
        *(struct.pack(">BBB", 0xC7, 3, 9) + b"abc", struct.pack(">BHB", 0xC8, 3, 9) + b"abc"),
        struct.pack(">BIB", 0xC9, 3, 9) + b"abc",
        *(bytes([0xD4 + power, 9]) + bytes(1 << power) for power in range(5)),
        *(bytes([0xCC + power]) + bytes(1 << power) for power in range(4)),
        *(bytes([0xD0 + power]) + bytes(1 << power) for power in range(4)),
        *(b"\xca" + bytes(4), b"\xcb" + bytes(8)),
        *(struct.pack(">BB", 0xD9, 3) + b"abc", struct.pack(">BH", 0xDA, 3) + b"abc"),
        struct.pack(">BI", 0xDB, 3) + b"abc",
        *(struct.pack(">BH", 0xDC, 2) + b"\x01\x02", struct.pack(">BI", 0xDD, 2) + b"\x01\x02"),
        *(struct.pack(">BH", 0xDE, 1) + b"\x01\x02", struct.pack(">BI", 0xDF, 1) + b"\x01\x02"),
    ]
    splitter = MessageSplitter()
    found: list[bytes] = []
    for byte in b"".join(kinds):
        splitter.feed(bytes([byte]))
        found.extend(splitter.messages())
    assert found == kinds


@pytest.mark.parametrize("tag", [0xC6, 0xC9, 0xDB, 0xDD, 0xDF])
@pytest.mark.parametrize("before", [b"", b"\x94\x00\x01"])
def test_length_of_two_gigabytes_is_refused_at_its_header(tag: int, before: bytes) -> None:
    splitter = MessageSplitter()
    tracemalloc.start()
    splitter.feed(before + struct.pack(">BIB", tag, 0x7FFF_FFFF, 0))
    with pytest.raises(MessageError, match="more than"):
        list(splitter.messages())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1 << 28  # other threads of the tests allocate too, but not two gigabytes


def test_arrays_that_promise_too_much_together_are_refused() -> None:
    splitter = MessageSplitter()
    splitter.feed(struct.pack(">BI", 0xDD, MOST_ITEMS // 4) * 5)
    with pytest.raises(MessageError, match="items"):
        list(splitter.messages())


@pytest.mark.parametrize(("depth", "accepted"), [(DEEPEST, True), (DEEPEST + 1, False)])
def test_nesting_is_bounded(depth: int, accepted: bool) -> None:
    splitter = MessageSplitter()
    splitter.feed(b"\x91" * depth + b"\xc0")
    if accepted:
        assert len(list(splitter.messages())) == 1
    else:
        with pytest.raises(MessageError, match="deeper"):
            list(splitter.messages())


def test_longest_message_is_taken_and_a_longer_one_is_not() -> None:
    payload = MOST_BYTES - 5
    splitter = MessageSplitter()
    splitter.feed(struct.pack(">BI", 0xC6, payload) + bytes(payload))
    (message,) = splitter.messages()
    assert len(message) == MOST_BYTES
    splitter.feed(struct.pack(">BI", 0xC6, payload + 1))
    with pytest.raises(MessageError, match="64 MiB"):
        list(splitter.messages())


def test_byte_that_msgpack_never_uses_is_refused() -> None:
    splitter = MessageSplitter()
    splitter.feed(b"\xc1")
    with pytest.raises(MessageError, match="no msgpack"):
        list(splitter.messages())
