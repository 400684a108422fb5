"""Where one message of a stream of msgpack ends, found before anything is built from it.

msgpack's own streaming decoder believes a header: an array that claims two thousand million items
gets its memory at once, and a string of that length is waited for. Here lengths are added up first.
A message is refused as soon as its headers promise more than the limits, and only messages that are
there in full reach the decoder.

Layout of the headers: the msgpack specification, section "Formats".
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import kernel
from carstage_sim.wire.errors import MessageError

MOST_BYTES = 64 << 20
MOST_ITEMS = 8 << 20
DEEPEST = 32

_WHOLE, _UNFINISHED, _TOO_LONG, _TOO_MANY, _TOO_DEEP, _NO_MSGPACK = range(6)
_REFUSALS = {
    _TOO_LONG: f"a message of more than {MOST_BYTES >> 20} MiB",
    _TOO_MANY: f"a message of more than {MOST_ITEMS} items",
    _TOO_DEEP: f"a message nested deeper than {DEEPEST}",
    _NO_MSGPACK: "no msgpack",
}
_AT, _DEPTH, _ITEMS, _PROMISED = range(4)
_STATE_SIZE = 4


@kernel
def _scan(  # type: ignore[no-untyped-def]
    data, state, stack, most_bytes, most_items
):
    """Go on from where the state left off; one of the codes above.

    Args:
        data: ``(N,)`` uint8, the message from its first byte on.
        state: ``(4,)`` int64: next header, depth, items seen, items promised and not yet seen.
        stack: ``(DEEPEST,)`` int64, items that each open array or map still lacks.
        most_bytes, most_items: limits.
    """
    size = data.shape[0]
    at, depth, items, promised = state[0], state[1], state[2], state[3]
    status = _UNFINISHED
    while at < size:
        tag = data[at]
        width = 0  # bytes of the length that follows the tag
        unit = 0  # what the length counts: 1 bytes, 2 items, 3 pairs of items
        body = 0
        children = 0
        if tag < 0x80 or tag >= 0xE0:  # small integers
            pass
        elif tag < 0x90:
            children = 2 * (tag & 0x0F)
        elif tag < 0xA0:
            children = tag & 0x0F
        elif tag < 0xC0:
            body = tag & 0x1F
        elif tag < 0xC4:  # nil, booleans
            if tag == 0xC1:
                status = _NO_MSGPACK
                break
        elif tag < 0xC7:  # bin
            unit, width = 1, 1 << (tag - 0xC4)
        elif tag < 0xCA:  # ext, with one byte for its type
            unit, width, body = 1, 1 << (tag - 0xC7), 1
        elif tag < 0xCC:  # floats
            body = 4 << (tag - 0xCA)
        elif tag < 0xD4:  # integers
            body = 1 << (tag & 0x03)
        elif tag < 0xD9:  # ext of a fixed size
            body = 1 + (1 << (tag - 0xD4))
        elif tag < 0xDC:  # str
            unit, width = 1, 1 << (tag - 0xD9)
        else:  # array, map
            unit, width = (2, 2 << (tag - 0xDC)) if tag < 0xDE else (3, 2 << (tag - 0xDE))
        after = at + 1 + width
        if after > size:
            break
        length = 0
        for i in range(at + 1, after):
            length = (length << 8) | data[i]
        if unit == 1:
            body += length
        elif unit >= 2:
            children = (unit - 1) * length
        after += body
        to_come = promised + children - (1 if depth > 0 else 0)
        # Every item that is still to come has a byte at least.
        if after + to_come > most_bytes:
            status = _TOO_LONG
            break
        if items + 1 + to_come > most_items:
            status = _TOO_MANY
            break
        if after > size:
            break
        at = after
        items += 1
        promised = to_come
        if children > 0:
            if depth == stack.shape[0]:
                status = _TOO_DEEP
                break
            stack[depth] = children
            depth += 1
            continue
        while depth > 0:
            stack[depth - 1] -= 1
            if stack[depth - 1] > 0:
                break
            depth -= 1
        if depth == 0:
            status = _WHOLE
            break
    state[0], state[1], state[2], state[3] = at, depth, items, promised
    return status


class MessageSplitter:
    """Cuts what one connection sends into whole messages.

    Args:
        most_bytes, most_items: limits of one message.
    """

    def __init__(self, most_bytes: int = MOST_BYTES, most_items: int = MOST_ITEMS) -> None:
        self._limits = (most_bytes, most_items)
        self._received = bytearray()
        self._begin = 0
        self._state: NDArray[np.int64] = np.zeros(_STATE_SIZE, np.int64)
        self._stack: NDArray[np.int64] = np.zeros(DEEPEST, np.int64)

    @property
    def unfinished_bytes(self) -> int:
        """Bytes that were received and not yet taken as part of a message."""
        return len(self._received) - self._begin

    def feed(self, data: bytes) -> None:
        """Take more bytes of the stream."""
        if self._begin:
            del self._received[: self._begin]
            self._begin = 0
        self._received += data

    def messages(self) -> Iterator[bytes]:
        """The whole messages that are there, one by one; the rest waits for more bytes.

        Raises:
            MessageError: the next one is no msgpack, or larger or deeper than the limits.
        """
        while self._begin < len(self._received):
            data = np.frombuffer(self._received, np.uint8)[self._begin :]
            status = _scan(data, self._state, self._stack, *self._limits)
            del data  # or the buffer could not grow
            if status == _UNFINISHED:
                return
            if status != _WHOLE:
                raise MessageError(_REFUSALS[status])
            end = self._begin + int(self._state[_AT])
            message = bytes(memoryview(self._received)[self._begin : end])
            self._begin = end
            self._state[:] = 0
            yield message


def warm_up() -> None:
    """Compile, or load, the kernel, so that the first client does not wait for it."""
    splitter = MessageSplitter()
    splitter.feed(b"\xc0")
    list(splitter.messages())
