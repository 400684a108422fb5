"""The streaming side: one connection per subscribed stream, frames pushed without copies.

A client opens a connection, sends the stream's number and then only reads. The server does not
close a stream: a client that is still subscribed would reconnect thousands of times a second.
Streams that nobody publishes to, and numbers that never existed, stay open and silent. Only who
sends more than the number, or takes nothing for seconds while the world waits for him, is closed;
a client that was merely stopped subscribes again by itself when it goes on.

In one frame the world waits for all of them together no longer than a moment: a subscriber that
never comes, or that does not read, must not hold up the others. What it has not taken by then is
kept for it, up to a bound. Who has been waited for once and reads too slowly to be done in that
moment is waited for again when that bound is reached, or when it has caught up.
"""

from __future__ import annotations

import enum
import logging
import math
import socket
import struct
import threading
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

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


LONGEST_WAIT_S = 0.25
"""In one frame, for all subscribers together; a tick may come after a whole frame of another's."""
_MISTRUST_S = 2.0
"""After a wait for who did not come: others may announce without end that they will."""
_MOST_UNREAD_BYTES = 64 << 20
_LOOKED_AT_FOR_S = 0.02
"""Who reads is asked often, and each of hundreds of sockets has to be looked at."""
_GIVEN_UP_AFTER_S = 2.0
"""Who takes nothing for so long is sent no more pictures that take long to draw."""


class Taking(enum.Enum):
    """What the subscribers of a stream take of what they are sent."""

    ALL = enum.auto()
    """One at least has taken everything."""
    UNKNOWN = enum.auto()
    """Nothing was sent yet, or it is being taken."""
    NOTHING = enum.auto()
    """There is none, or none took anything for seconds."""


class _Behind(NamedTuple):
    """How far a subscriber was when it was last looked at whether it may catch up."""

    since_s: float
    written_bytes: int
    may_catch_up: bool


class _Progress:
    """How far a subscriber is with what it was sent."""

    def __init__(self) -> None:
        self._taken_bytes = -1
        self._since_s = 0.0
        self._behind: _Behind | None = None

    def catch_up(self) -> None:
        """It has been written all that it was sent."""
        self._behind = None

    def before_sending(self, channel: Channel) -> None:
        """Something is about to be sent: who has taken everything is not slow with it yet."""
        taken_bytes = channel.taken_bytes
        if taken_bytes == channel.sent_bytes:
            self._taken_bytes, self._since_s = taken_bytes, time.monotonic()

    def may_catch_up(self, channel: Channel, within_s: float) -> bool:
        """Whether all may be written in time, at its rate of late; of who just fell behind, yes."""
        now_s, unwritten_bytes = time.monotonic(), channel.unwritten_bytes
        written_bytes = channel.sent_bytes - unwritten_bytes
        if self._behind is None:
            self._behind = _Behind(now_s, written_bytes, may_catch_up=True)
        elif (passed_s := now_s - self._behind.since_s) >= LONGEST_WAIT_S:
            bytes_per_s = (written_bytes - self._behind.written_bytes) / passed_s
            in_time = bytes_per_s > 0.0 and bytes_per_s * within_s >= unwritten_bytes
            self._behind = _Behind(now_s, written_bytes, may_catch_up=in_time)
        return self._behind.may_catch_up

    def taking(self, channel: Channel) -> Taking:
        """What it takes, as far as seen by asking again and again."""
        now_s, taken_bytes = time.monotonic(), channel.taken_bytes
        if taken_bytes > self._taken_bytes:
            self._taken_bytes, self._since_s = taken_bytes, now_s
        if taken_bytes == channel.sent_bytes:
            self._since_s = now_s
            return Taking.ALL if taken_bytes else Taking.UNKNOWN
        gave_up = now_s - self._since_s > _GIVEN_UP_AFTER_S
        return Taking.NOTHING if gave_up else Taking.UNKNOWN


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
        self._subscribers: dict[int, dict[Channel, _Progress]] = {}
        self._taking: dict[int, tuple[float, Taking]] = {}
        self._awaited: dict[int, dict[object, float]] = {}
        self._waits_until_s = math.inf
        self._trusts_again_s = 0.0
        self._ended = threading.Event()
        self.port = int(sock.getsockname()[1])
        loop.listen(sock, self._accept)

    def close(self) -> None:
        """Let go of a publisher that waits for a slow subscriber."""
        self._ended.set()

    def begin_frame(self) -> None:
        """From now on, wait for subscribers :data:`LONGEST_WAIT_S` in all, until called again."""
        self._waits_until_s = time.monotonic() + LONGEST_WAIT_S

    def expect(
        self,
        stream_id: int,
        within_s: float = SENSORS_SUBSCRIBED_WITHIN_S,
        who: object = None,
    ) -> None:
        """Expect one more subscriber of a stream: a client just got its address.

        Clients subscribe in a thread of their own. A script that listens and ticks at once would
        miss its first frame whenever the tick is faster than that thread.

        Args:
            stream_id: the stream.
            within_s: how long to expect it.
            who: the client, for :meth:`awaits`.
        """
        with self._lock:
            self._forget_late()
            self._awaited.setdefault(stream_id, {})[who] = time.monotonic() + within_s

    def awaits(self, who: object) -> bool:
        """Whether a client is expected to subscribe to something still."""
        with self._lock:
            self._forget_late()
            return any(who in expected for expected in self._awaited.values())

    def _forget_late(self) -> None:
        """Expect nobody any more whose time is over. The lock is held."""
        now_s = time.monotonic()
        kept = {
            stream_id: {who: due_s for who, due_s in expected.items() if due_s > now_s}
            for stream_id, expected in self._awaited.items()
        }
        self._awaited = {stream_id: expected for stream_id, expected in kept.items() if expected}

    def listeners(self, stream_id: int) -> int:
        """How many connections are subscribed to a stream, after those expected a moment ago."""
        with self._lock:
            now_s = time.monotonic()
            due_s = max(self._awaited.get(stream_id, {}).values(), default=0.0)
            due_s = min(due_s, self._waits_until_s)
            if due_s > now_s >= self._trusts_again_s:
                came = self._lock.wait_for(
                    lambda: stream_id not in self._awaited or self._ended.is_set(), due_s - now_s
                )
                if not came:
                    self._trusts_again_s = time.monotonic() + _MISTRUST_S
            return len(self._subscribers.get(stream_id, ()))

    def taking(self, stream_id: int) -> Taking:
        """What the subscribers of a stream took a moment ago: what the one takes who takes most."""
        with self._lock:
            now_s = time.monotonic()
            looked_at_s, taking = self._taking.get(stream_id, (-math.inf, Taking.NOTHING))
            if now_s - looked_at_s < _LOOKED_AT_FOR_S:
                return taking
            subscribers = self._subscribers.get(stream_id, {})
            found = {progress.taking(channel) for channel, progress in subscribers.items()}
            taking = next((taking for taking in Taking if taking in found), Taking.NOTHING)
            if subscribers:
                self._taking[stream_id] = (now_s, taking)
            return taking

    def publish(self, stream_id: int, parts: Sequence[Buffer], *, wait: bool) -> None:
        """Send one message to every subscriber of a stream.

        Args:
            stream_id: the stream.
            parts: the message's payload in pieces; they must not change afterwards.
            wait: what to do while a subscriber's previous message is not written: wait for it
                (synchronous mode) or leave this message out for that subscriber. When the frame's
                time for waiting is over, the message is kept for the subscriber, or left out if
                far too many are.
        """
        message = _framed(parts)
        with self._lock:
            subscribers = list(self._subscribers.get(stream_id, {}).items())
            for channel, progress in subscribers:
                progress.before_sending(channel)
        for channel, progress in subscribers:
            if not channel.unwritten_bytes:
                progress.catch_up()
            else:
                if not wait:
                    logger.debug("stream %d: %s is slow, left out", stream_id, channel.peer)
                    continue
                self._wait_written(stream_id, channel, progress)
                if channel.unwritten_bytes > _MOST_UNREAD_BYTES:
                    self._warnings.warn(
                        f"subscriber {channel.peer} is slow", f"stream {stream_id} left out"
                    )
                    continue
            channel.send(message)

    def _wait_written(self, stream_id: int, channel: Channel, progress: _Progress) -> None:
        """Wait until a message is written, the frame's time is over, or the patience ends."""
        until_s = self._waits_until_s
        in_time = progress.may_catch_up(channel, until_s - time.monotonic())
        if not in_time and channel.unwritten_bytes <= _MOST_UNREAD_BYTES:
            until_s = -math.inf
        while not self._ended.is_set():
            left_s = until_s - time.monotonic()
            if channel.wait_written(max(min(_POLL_S, self._patience_s, left_s), 0.0)):
                return
            if channel.stalled_s >= self._patience_s:
                self._warnings.warn(
                    f"subscriber {channel.peer} takes nothing",
                    f"stream {stream_id} dropped after {self._patience_s:g} s",
                )
                channel.close()
                return
            if left_s <= 0.0:
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
            self._subscribers.setdefault(stream_id, {})[channel] = _Progress()
            self._taking.pop(stream_id, None)
            # Nobody says who subscribes: it is taken for the one that is expected longest.
            expected = self._awaited.get(stream_id, {})
            expected.pop(next(iter(expected), None), None)
            if not expected:
                self._awaited.pop(stream_id, None)
            self._lock.notify_all()

    def _unsubscribe(self, stream_id: int, channel: Channel) -> None:
        logger.debug("stream %d: unsubscribed by %s", stream_id, channel.peer)
        with self._lock:
            channels = self._subscribers[stream_id]
            del channels[channel]
            if not channels:
                del self._subscribers[stream_id]
                self._taking.pop(stream_id, None)


def _framed(parts: Sequence[Buffer]) -> list[Buffer]:
    size = sum(memoryview(part).nbytes for part in parts)
    return [struct.pack("<I", size), *parts]
