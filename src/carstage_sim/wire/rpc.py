"""The msgpack-rpc side: bytes to requests, results to bytes.

Requests wait in one bounded queue for the thread that owns the world. While the queue is full
nothing more is read from any connection: clients that ask faster than the world serves them wait.
"""

from __future__ import annotations

import logging
import queue
import socket
import threading
from dataclasses import dataclass, field
from typing import Any

import msgpack

from carstage_sim.wire.socket_loop import Channel, SocketLoop

logger = logging.getLogger(__name__)

_REQUEST = 0
_REPLY = 1
_QUEUED_REQUESTS = 4096
_MOST_UNREAD_REPLY_BYTES = 256 << 20
_LOGGED_CHARACTERS = 300


class Connection:
    """One client: replies to it, and the replies that are kept back for a while.

    Attributes:
        peer: the client's host address.
        held_calls: calls whose replies are kept back.
    """

    def __init__(self, channel: Channel) -> None:
        self.peer = channel.peer
        self.held_calls: frozenset[str] = frozenset()
        self._channel = channel
        self._held: list[bytes] = []

    def reply(self, request: Request, result: Any) -> None:
        """Answer a request, or keep the answer back if its call is held."""
        message = msgpack.packb(
            [_REPLY, request.message_id, None, result], unicode_errors="surrogateescape"
        )
        if request.name in self.held_calls:
            self._held.append(message)
        else:
            self._send(message)

    def refuse(self, request: Request, text: str) -> None:
        """Answer with an error of the envelope, as rpclib does for calls that do not exist."""
        self._send(msgpack.packb([_REPLY, request.message_id, text, None]))

    def take_held(self) -> list[bytes]:
        """Keep nothing back any more; returns what was kept so far, for :meth:`send_held`."""
        self.held_calls = frozenset()
        held, self._held = self._held, []
        return held

    def send_held(self, messages: list[bytes]) -> None:
        """Send what :meth:`take_held` returned."""
        for message in messages:
            self._send(message)

    def _send(self, message: bytes) -> None:
        self._channel.send([message])
        if self._channel.unwritten_bytes > _MOST_UNREAD_REPLY_BYTES:
            logger.warning("client %s does not read its replies: connection dropped", self.peer)
            self._channel.close()


@dataclass(frozen=True, slots=True)
class Request:
    """One call: ``waits`` tells whether the client waits for its result."""

    connection: Connection
    message_id: int
    name: str
    waits: bool
    arguments: list[Any] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Disconnected:
    """A client is gone."""

    connection: Connection


Event = Request | Disconnected


class RpcServer:
    """Accepts clients and queues what they ask.

    Args:
        loop: the socket loop that reads and writes; its thread does nothing else.
        sock: what to accept clients on, from :func:`carstage_sim.wire.socket_loop.bind`.

    Raises:
        PortInUseError: something else listens there.
    """

    def __init__(self, loop: SocketLoop, sock: socket.socket) -> None:
        self._events: queue.Queue[Event] = queue.Queue(_QUEUED_REQUESTS)
        self._ended = threading.Event()
        self.port = int(sock.getsockname()[1])
        loop.listen(sock, self._accept)

    def close(self) -> None:
        """Stop queueing, so that the loop's thread can end."""
        self._ended.set()

    def next_event(self, timeout_s: float) -> Event | None:
        """The oldest event that is not served yet, or None when none came in time."""
        try:
            if timeout_s <= 0.0:
                return self._events.get_nowait()
            return self._events.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def _accept(self, channel: Channel) -> None:
        connection = Connection(channel)
        unpacker = msgpack.Unpacker(
            max_buffer_size=0, unicode_errors="surrogateescape", strict_map_key=False
        )

        def received(data: bytes) -> None:
            try:
                unpacker.feed(data)
                for message in unpacker:
                    self._put(_request(connection, message))
            except (ValueError, TypeError, msgpack.UnpackException) as error:
                logger.warning("client %s speaks no msgpack-rpc (%s): dropped", channel.peer, error)
                channel.close()

        channel.on_data = received
        channel.on_close = lambda: self._put(Disconnected(connection))

    def _put(self, event: Event) -> None:
        while not self._ended.is_set():
            try:
                self._events.put(event, timeout=0.2)
            except queue.Full:
                continue
            return


def _request(connection: Connection, message: Any) -> Request:
    """Check the envelope ``[0, id, name, [[asynchronous], arguments…]]``.

    Raises:
        ValueError: it is another shape.
    """
    match message:
        case [0, int(message_id), str(name), [[bool(asynchronous)], *arguments]]:
            request = Request(connection, message_id, name, not asynchronous, arguments)
        case [0, int(message_id), str(name), [*arguments]]:
            request = Request(connection, message_id, name, True, arguments)
        case _:
            raise ValueError(f"no request: {str(message)[:80]}")
    if logger.isEnabledFor(logging.DEBUG):
        logger.debug("%s%s", name, str(request.arguments)[:_LOGGED_CHARACTERS])
    return request
