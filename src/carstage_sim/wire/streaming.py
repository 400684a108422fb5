"""The streaming side: one connection per subscribed stream, frames pushed without copies.

A client opens a connection, sends the stream's number and then only reads. The server does not
close a stream: a client that is still subscribed would reconnect thousands of times a second.
Streams that nobody publishes to, and numbers that never existed, stay open and silent. Only who
sends more than the number, or takes nothing for seconds while the world waits for him, is closed;
a client that was merely stopped subscribes again by itself when it goes on.
"""

from __future__ import annotations

import logging
import socket
import struct
import threading
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from carstage_sim.wire.channel import Channel
from carstage_sim.wire.socket_loop import SocketLoop
from carstage_sim.wire.throttled_warnings import ThrottledWarnings

if TYPE_CHECKING:
    from typing_extensions import Buffer

logger = logging.getLogger(__name__)

_HANDSHAKE_BYTES = 4
_POLL_S = 0.5
SENSORS_SUBSCRIBED_WITHIN_S = 0.25
SNAPSHOTS_SUBSCRIBED_WITHIN_S = 2.0
"""A client that misses the snapshot of its own tick waits for it until it gives up."""
_PATIENCE_S = 4.0
"""Less than the 5 s that clients wait for an answer unless told otherwise."""


class StreamingServer:
    """Accepts subscribers and publishes messages to them.

    Args:
        loop: the socket loop that finishes writes.
        sock: what to accept clients on, from :func:`carstage_sim.wire.socket_loop.bind`.
        patience_s: how long a publisher that waits bears a subscriber that takes nothing at all.

    Raises:
        PortInUseError: something else listens there.
    """

    def __init__(
        self, loop: SocketLoop, sock: socket.socket, patience_s: float = _PATIENCE_S
    ) -> None:
        self._patience_s = patience_s
        self._warnings = ThrottledWarnings(logger)
        self._lock = threading.Condition()
        self._subscribers: dict[int, list[Channel]] = {}
        self._awaited: dict[int, tuple[int, float]] = {}
        self._ended = threading.Event()
        self.port = int(sock.getsockname()[1])
        loop.listen(sock, self._accept)

    def close(self) -> None:
        """Let go of a publisher that waits for a slow subscriber."""
        self._ended.set()

    def expect(self, stream_id: int, within_s: float = SENSORS_SUBSCRIBED_WITHIN_S) -> None:
        """Expect one more subscriber of a stream: a client just got its address.

        Clients subscribe in a thread of their own. A script that listens and ticks at once would
        miss its first frame whenever the tick is faster than that thread.
        """
        now_s = time.monotonic()
        with self._lock:
            self._awaited = {i: due for i, due in self._awaited.items() if due[1] > now_s}
            count, _ = self._awaited.get(stream_id, (0, now_s))
            self._awaited[stream_id] = (count + 1, now_s + within_s)

    def listeners(self, stream_id: int) -> int:
        """How many connections are subscribed to a stream, after those expected a moment ago."""
        with self._lock:
            _, due_s = self._awaited.get(stream_id, (0, 0.0))
            self._lock.wait_for(
                lambda: stream_id not in self._awaited or self._ended.is_set(),
                max(due_s - time.monotonic(), 0.0),
            )
            self._awaited.pop(stream_id, None)
            return len(self._subscribers.get(stream_id, ()))

    def publish(self, stream_id: int, parts: Sequence[Buffer], *, wait: bool) -> None:
        """Send one message to every subscriber of a stream.

        Args:
            stream_id: the stream.
            parts: the message's payload in pieces; they must not change afterwards.
            wait: what to do while a subscriber's previous message is not written: wait for it
                (synchronous mode) or leave this message out for that subscriber.
        """
        message = _framed(parts)
        with self._lock:
            channels = list(self._subscribers.get(stream_id, ()))
        for channel in channels:
            if channel.unwritten_bytes:
                if not wait:
                    logger.debug("stream %d: %s is slow, left out", stream_id, channel.peer)
                    continue
                self._wait_written(stream_id, channel)
            channel.send(message)

    def _wait_written(self, stream_id: int, channel: Channel) -> None:
        while not self._ended.is_set():
            if channel.wait_written(min(_POLL_S, self._patience_s)):
                return
            if channel.stalled_s >= self._patience_s:
                self._warnings.warn(
                    f"subscriber {channel.peer} takes nothing",
                    f"stream {stream_id} dropped after {self._patience_s:g} s",
                )
                channel.close()
                return

    def _accept(self, channel: Channel) -> None:
        received = bytearray()

        def handshake(data: bytes) -> None:
            received.extend(data)
            if len(received) == _HANDSHAKE_BYTES:
                (stream_id,) = struct.unpack_from("<I", received)
                self._subscribe(stream_id, channel)
            elif len(received) > _HANDSHAKE_BYTES:
                self._warnings.warn(
                    f"subscriber {channel.peer} talks", "a subscriber sends a stream's number only"
                )
                channel.close()

        channel.on_data = handshake

    def _subscribe(self, stream_id: int, channel: Channel) -> None:
        logger.debug("stream %d: subscribed by %s", stream_id, channel.peer)
        channel.on_close = lambda: self._unsubscribe(stream_id, channel)
        with self._lock:
            self._subscribers.setdefault(stream_id, []).append(channel)
            count, due_s = self._awaited.pop(stream_id, (0, 0.0))
            if count > 1:
                self._awaited[stream_id] = (count - 1, due_s)
            self._lock.notify_all()

    def _unsubscribe(self, stream_id: int, channel: Channel) -> None:
        logger.debug("stream %d: unsubscribed by %s", stream_id, channel.peer)
        with self._lock:
            channels = self._subscribers[stream_id]
            channels.remove(channel)
            if not channels:
                del self._subscribers[stream_id]


def _framed(parts: Sequence[Buffer]) -> list[Buffer]:
    size = sum(memoryview(part).nbytes for part in parts)
    return [struct.pack("<I", size), *parts]
