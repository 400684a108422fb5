"""The msgpack-rpc side: bytes to requests, results to bytes.

The socket thread cuts what arrives into messages and queues them as bytes; the thread that owns the
world decodes one at a time. Every connection has a bounded part of the queue. A client that asks
faster than the world serves it, or that does not read its replies, is not read from until it
catches up, and the others are served in between. Calls are served in the order in which they
came, but for a client whose calls have taken long: those that wait go first.
"""

from __future__ import annotations

import itertools
import logging
import reprlib
import socket
import threading
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import msgpack

from carstage_sim.wire.channel import Channel
from carstage_sim.wire.errors import MessageError
from carstage_sim.wire.framing import MessageSplitter, warm_up
from carstage_sim.wire.socket_loop import SocketLoop
from carstage_sim.wire.throttled_warnings import ThrottledWarnings

logger = logging.getLogger(__name__)

_REQUEST = 0
_REPLY = 1
_QUEUED_REQUESTS = 128
_QUEUED_BYTES = 64 << 20
_MOST_UNFINISHED_BYTES = 256 << 20
_UNREAD_REPLY_BYTES = 1 << 20
_TURN_S = 0.02
"""How long the calls of one client may take while others wait."""

_shortener = reprlib.Repr()
_shortener.maxstring = _shortener.maxother = 80
_shortener.maxlist = 8


def shortened(value: Any) -> str:
    """A value for a log line, whatever a client put into it."""
    return _shortener.repr(value)


@dataclass(frozen=True, slots=True)
class Packed:
    """A value in msgpack, for results that are large and always the same.

    Attributes:
        data: its bytes.
    """

    data: bytes

    @staticmethod
    def of(value: Any) -> Packed:
        """Pack a value."""
        return Packed(_packer().pack(value))


_numbers = itertools.count(1)


class Connection:
    """One client: its requests that wait, replies to it, and those that are kept back for a while.

    Attributes:
        peer: the client's host address.
        number: of the connection, from 1; no other one has it.
        held_calls: calls whose replies are kept back.
        splitter: cuts what it sends into messages. Only the socket thread touches it.
        waiting: its messages that are queued.
        waiting_bytes: their bytes.
        deferred: those that were due while the client did not read its replies.
        used_s: how long its calls took since others were last let go first, or none of its own
            waited. Only the thread that serves them touches it.
    """

    def __init__(self, channel: Channel, warnings: ThrottledWarnings) -> None:
        self.peer = channel.peer
        self.number = next(_numbers)
        self.held_calls: frozenset[str] = frozenset()
        self.splitter = MessageSplitter()
        self.waiting = 0
        self.waiting_bytes = 0
        self.deferred: list[_Queued] = []
        self.used_s = 0.0
        self._channel = channel
        self._warnings = warnings
        self._held: list[bytes] = []

    @property
    def closed(self) -> bool:
        """Whether the client is gone."""
        return self._channel.closed

    @property
    def reads(self) -> bool:
        """Whether the client has taken most of its replies."""
        return self._channel.unwritten_bytes <= _UNREAD_REPLY_BYTES

    @property
    def may_queue(self) -> bool:
        """Whether one more of its requests may wait."""
        return self.waiting < _QUEUED_REQUESTS and self.waiting_bytes < _QUEUED_BYTES and self.reads

    def reply(self, request: Request, result: Any) -> None:
        """Answer a request, or keep the answer back if its call is held."""
        message = _packer().pack([_REPLY, request.message_id, None, result])
        self._reply(request, message)

    def reply_packed(self, request: Request, value: Packed) -> None:
        """Answer a request with ``Response<T>`` of a packed value, as :meth:`reply` does."""
        packer = _packer()
        head = [packer.pack_array_header(4), *map(packer.pack, (_REPLY, request.message_id, None))]
        response = [packer.pack_array_header(1), packer.pack_array_header(2), packer.pack(1)]
        self._reply(request, b"".join([*head, *response, value.data]))

    def _reply(self, request: Request, message: bytes) -> None:
        if request.name in self.held_calls:
            self._held.append(message)
        else:
            self._send(message)

    def refuse(self, request: Request, text: str) -> None:
        """Answer with an error of the envelope, as rpclib does for calls that do not exist."""
        self._send(
            msgpack.packb([_REPLY, request.message_id, text, None], unicode_errors="replace")
        )

    def take_held(self) -> list[bytes]:
        """Keep nothing back any more; returns what was kept so far, for :meth:`send_held`."""
        self.held_calls = frozenset()
        held, self._held = self._held, []
        return held

    def send_held(self, messages: list[bytes]) -> None:
        """Send what :meth:`take_held` returned."""
        for message in messages:
            self._send(message)

    def drop(self, kind: str, detail: str = "") -> None:
        """Close the connection for a reason that goes to the log."""
        if not self._channel.closed:
            self._warnings.warn(f"client {self.peer} {kind}", detail or "connection dropped")
            self._channel.close()

    def _send(self, message: bytes) -> None:
        self._channel.send([message])


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

_Queued = tuple[Connection, Channel, bytes | None]
"""A message that waits, None for the end of the client."""


class RpcServer:
    """Accepts clients and queues what they ask, in the order in which it arrived.

    Args:
        loop: the socket loop that reads and writes; its thread does nothing else.
        sock: what to accept clients on, from :func:`carstage_sim.wire.socket_loop.bind`.

    Raises:
        PortInUseError: something else listens there.
    """

    def __init__(self, loop: SocketLoop, sock: socket.socket) -> None:
        warm_up()
        self._loop = loop
        self._queue: deque[_Queued] = deque()
        self._filled = threading.Condition()
        self._woken = False
        self._unfinished_bytes = 0
        self._warnings = ThrottledWarnings(logger)
        self.port = int(sock.getsockname()[1])
        loop.listen(sock, self._accept)

    def wake(self) -> None:
        """Let :meth:`next_event` return at once, or its next call; from any thread."""
        with self._filled:
            self._woken = True
            self._filled.notify()

    @property
    def waiting(self) -> int:
        """How many messages wait to be served."""
        return len(self._queue)

    def next_event(self, timeout_s: float) -> Event | None:
        """The oldest event that is not served yet; None when none came in time, or if woken."""
        with self._filled:
            if not self._queue and timeout_s > 0.0:
                self._filled.wait_for(lambda: self._queue or self._woken, timeout_s)
            self._woken = False
            queued = self._next()
            if queued is None:
                return None
            connection, channel, message = queued
            if message is None:
                return Disconnected(connection)
            connection.waiting -= 1
            connection.waiting_bytes -= len(message)
            if not connection.waiting:
                connection.used_s = 0.0  # it asks for no more than it is answered
            low = connection.waiting == _QUEUED_REQUESTS // 2 or not connection.waiting
        if low and not channel.reading:
            self._loop.call(lambda: self._refill(connection, channel))
        try:
            return _request(connection, message)
        except (ValueError, TypeError, msgpack.UnpackException) as error:
            connection.drop("speaks no msgpack-rpc", str(error))
            return None

    def _next(self) -> _Queued | None:
        """The message that is served next, None if nobody waits. The condition is held."""
        while self._queue:
            connection, _, message = self._queue[0]
            if message is not None and (connection.deferred or not connection.reads):
                connection.deferred.append(self._queue.popleft())
            elif connection.used_s > _TURN_S:
                self._let_others_go_first(connection)
            else:
                return self._queue.popleft()
        return None

    def _let_others_go_first(self, connection: Connection) -> None:
        """End a client's turn: all that waits of it goes behind all others. The condition is held.

        Its own messages stay in their order.
        """
        connection.used_s = 0.0
        others = [queued for queued in self._queue if queued[0] is not connection]
        own = [queued for queued in self._queue if queued[0] is connection]
        self._queue = deque([*others, *own])

    def _resume(self, connection: Connection) -> None:
        """Serve next what was deferred. In the loop's thread."""
        with self._filled:
            self._queue.extendleft(reversed(connection.deferred))
            connection.deferred.clear()
            self._filled.notify()

    def _accept(self, channel: Channel) -> None:
        connection = Connection(channel, self._warnings)

        def received(data: bytes) -> None:
            connection.splitter.feed(data)
            self._unfinished_bytes += len(data)
            self._refill(connection, channel)
            if self._unfinished_bytes > _MOST_UNFINISHED_BYTES:
                connection.drop("sends a large message while others do", "no room for it")

        def written() -> None:
            self._resume(connection)
            self._refill(connection, channel)

        def closed() -> None:
            self._resume(connection)
            self._unfinished_bytes -= connection.splitter.unfinished_bytes
            self._put(connection, channel, None)

        channel.on_data = received
        channel.on_written = written
        channel.on_close = closed

    def _refill(self, connection: Connection, channel: Channel) -> None:
        """Queue what the connection may queue; read on only if that was all. In the loop's thread.

        So the end of a client is seen only when everything that it sent before has been queued.
        """
        while True:
            try:
                while connection.may_queue:
                    message = next(connection.splitter.messages(), None)
                    if message is None:
                        channel.read_on(True)
                        return
                    self._unfinished_bytes -= len(message)
                    self._put(connection, channel, message)
            except MessageError as error:
                connection.drop("speaks no msgpack-rpc", str(error))
                return
            channel.read_on(False)
            # The world may have caught up before it could see that nobody reads.
            if not connection.may_queue:
                return

    def _put(self, connection: Connection, channel: Channel, message: bytes | None) -> None:
        with self._filled:
            if message is not None:
                connection.waiting += 1
                connection.waiting_bytes += len(message)
            self._queue.append((connection, channel, message))
            self._filled.notify()


def _packer() -> msgpack.Packer:
    """Packs texts that are no UTF-8 as the bytes that a client sent."""
    return msgpack.Packer(unicode_errors="surrogateescape")


def _request(connection: Connection, message: bytes) -> Request:
    """Decode a message and check the envelope ``[0, id, name, [[asynchronous], arguments…]]``.

    Raises:
        ValueError: it is another shape.
    """
    match msgpack.unpackb(message, unicode_errors="surrogateescape", strict_map_key=False):
        case [0, int(message_id), str(name), [[bool(asynchronous)], *arguments]]:
            request = Request(connection, message_id, name, not asynchronous, arguments)
        case [0, int(message_id), str(name), [*arguments]]:
            request = Request(connection, message_id, name, True, arguments)
        case other:
            raise ValueError(f"no request: {shortened(other)}")
    if logger.isEnabledFor(logging.DEBUG):
        logger.debug("%s%s", name, shortened(request.arguments))
    return request
