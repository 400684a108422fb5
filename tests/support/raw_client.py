"""A client that speaks bare msgpack-rpc, for what the real one never does."""

from __future__ import annotations

import socket
import struct
from types import TracebackType
from typing import Any

import msgpack

_RECEIVE_BUFFER_BYTES = 1 << 18
"""Set, as the kernel lets the buffer of who reads much grow to tens of megabytes otherwise."""


class RawClient:
    """Sends requests one by one and returns ``(error, result)``."""

    def __init__(self, host: str, port: int) -> None:
        self.socket = socket.create_connection((host, port), timeout=20.0)
        self._unpacker = msgpack.Unpacker(strict_map_key=False)
        self._id = 0

    def __enter__(self) -> RawClient:
        return self

    def __exit__(
        self,
        _type: type[BaseException] | None,
        _value: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self.socket.close()

    def send(self, name: str, *arguments: Any) -> None:
        """Send a request whose answer nobody waits for yet."""
        self._id += 1
        self.socket.sendall(msgpack.packb([0, self._id, name, [[False], *arguments]]))

    def call(self, name: str, *arguments: Any) -> tuple[Any, Any]:
        self.send(name, *arguments)
        while True:
            for message in self._unpacker:
                kind, message_id, error, result = message
                assert (kind, message_id) == (1, self._id)
                return error, result
            data = self.socket.recv(1 << 16)
            assert data, "the server closed the connection"
            self._unpacker.feed(data)

    def value(self, name: str, *arguments: Any) -> Any:
        """The value of a call that must succeed."""
        error, result = self.call(name, *arguments)
        assert error is None
        ((kind, *rest),) = result
        assert kind in (1, False), result
        return rest[0] if rest else None


def subscribe(host: str, port: int, stream_id: int) -> socket.socket:
    """A connection that is subscribed to a stream, with a receive buffer that does not grow."""
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
    connection.settimeout(5.0)
    connection.connect((host, port))
    connection.sendall(struct.pack("<I", stream_id))
    return connection


def read_message(connection: socket.socket) -> bytes:
    """The payload of the next message of a stream."""
    (size,) = struct.unpack("<I", read_bytes(connection, 4))
    return read_bytes(connection, size)


def await_first_message(client: RawClient, stream: socket.socket) -> bytes:
    """Tick until the server has seen the subscription; the message of the last tick."""
    for _ in range(100):
        frame = client.value("tick_cue")
        stream.settimeout(0.1)
        try:
            message = read_message(stream)
        except TimeoutError:
            continue
        stream.settimeout(5.0)
        # A message may be late for its own tick: then those of later ticks follow it.
        while struct.unpack_from("<Q", message, 8) != (frame,):
            message = read_message(stream)
        return message
    raise AssertionError("no message came")


def read_bytes(connection: socket.socket, size: int) -> bytes:
    parts = b""
    while len(parts) < size:
        data = connection.recv(size - len(parts))
        assert data, "the server closed the stream"
        parts += data
    return parts
