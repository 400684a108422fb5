"""A connected socket that one thread reads and every thread may write to."""

from __future__ import annotations

import logging
import selectors
import socket
import struct
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if sys.platform == "linux":
    import fcntl
    import termios

if TYPE_CHECKING:
    from typing_extensions import Buffer

    from carstage_sim.wire.socket_loop import SocketLoop

logger = logging.getLogger(__name__)

_RECEIVE_BYTES = 1 << 18
_PARTS_AT_ONCE = 64


class Channel:
    """A connected socket: reads arrive by callback, writes may come from any thread.

    Args:
        loop: the loop that watches the socket.
        sock: a connected socket; the channel owns it.
        peer: host address of the other side.

    Attributes:
        on_data: called in the loop's thread with what was received.
        on_written: called in the loop's thread when all that waited is written.
        on_close: called in the loop's thread when the connection is gone.
        reading: whether the loop reads; while it does not, the other side waits.
        silent: whether nothing was ever received.
        sent_bytes: how much was ever to be sent.
    """

    def __init__(self, loop: SocketLoop, sock: socket.socket, peer: str) -> None:
        self.peer = peer
        self.on_data: Callable[[bytes], None] = lambda _data: None
        self.on_written: Callable[[], None] = lambda: None
        self.on_close: Callable[[], None] = lambda: None
        self.reading = True
        self.silent = True
        self.sent_bytes = 0
        self._loop = loop
        self._sock = sock
        self._unwritten: deque[memoryview] = deque()
        self._unwritten_bytes = 0
        self._progress_s = 0.0
        self._changed = threading.Condition()
        self._closing = False

    @property
    def closed(self) -> bool:
        """Whether the connection is gone, or about to be closed."""
        return self._closing

    @property
    def unwritten_bytes(self) -> int:
        """Bytes that the kernel has not taken yet."""
        return self._unwritten_bytes

    @property
    def taken_bytes(self) -> int:
        """Bytes that reached the other side, of :attr:`sent_bytes`.

        Where the system does not tell what waits in its own buffers, what it accepted.
        """
        with self._changed:
            unwritten = self._unwritten_bytes
            waiting = 0 if self._closing else _unacknowledged_bytes(self._sock)
            return self.sent_bytes - unwritten - waiting

    @property
    def stalled_s(self) -> float:
        """For how long the other side has taken nothing of what waits; 0 when nothing waits."""
        with self._changed:
            return time.monotonic() - self._progress_s if self._unwritten else 0.0

    def fileno(self) -> int:
        """The socket's descriptor, for the selector."""
        return self._sock.fileno()

    def send(self, parts: Sequence[Buffer]) -> None:
        """Write ``parts`` in order; what does not fit now is finished by the loop's thread.

        The buffers must not change until they are written.
        """
        filled = [view for part in parts if (view := memoryview(part)).nbytes]
        views = [view.cast("B") for view in filled]  # an empty view cannot be cast
        with self._changed:
            if self._closing:
                return
            was_idle = not self._unwritten
            self._unwritten.extend(views)
            size = sum(view.nbytes for view in views)
            self._unwritten_bytes += size
            self.sent_bytes += size
            if was_idle:
                self._progress_s = time.monotonic()
                self._write()
                if self._unwritten:
                    self._loop.call(self._watch)

    def wait_written(self, timeout_s: float) -> bool:
        """Wait until everything is written or the connection is gone; false on timeout."""
        with self._changed:
            return self._changed.wait_for(lambda: self._closing or not self._unwritten, timeout_s)

    def read_on(self, reading: bool) -> None:
        """Go on reading, or leave what arrives to the kernel. Only from the loop's thread."""
        if self.reading != reading:
            self.reading = reading
            self._watch()

    def close(self) -> None:
        """Close the connection soon; nothing more is sent, what waits is thrown away."""
        with self._changed:
            if self._closing:
                return
            self._give_up()
        self._loop.call(self.shut)

    def _give_up(self) -> None:
        """Nothing more goes out. The condition is held."""
        self._closing = True
        self._unwritten.clear()
        self._unwritten_bytes = 0
        self._changed.notify_all()

    def _write(self) -> None:
        """Write what the kernel takes. The condition is held."""
        try:
            while self._unwritten:
                sent = self._sock.sendmsg(list(self._unwritten)[:_PARTS_AT_ONCE])
                self._progress_s = time.monotonic()
                self._unwritten_bytes -= sent
                while sent:
                    first = self._unwritten.popleft()
                    if sent < first.nbytes:
                        self._unwritten.appendleft(first[sent:])
                        break
                    sent -= first.nbytes
        except BlockingIOError:
            return
        except OSError as error:
            logger.debug("write to %s failed: %s", self.peer, error)
            self._give_up()
            self._loop.call(self.shut)
            return
        self._changed.notify_all()

    def readable(self) -> None:
        """Called by the loop when bytes or the end arrived."""
        try:
            data = self._sock.recv(_RECEIVE_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            logger.debug("read from %s failed: %s", self.peer, error)
            data = b""
        if self._closing:
            return
        if data:
            self._loop.spoke(self)
            self.on_data(data)
        else:
            self.close()

    def writable(self) -> None:
        """Called by the loop when there is room."""
        with self._changed:
            self._write()
            if self._unwritten or self._closing:
                return
        self._watch()
        self.on_written()

    def _watch(self) -> None:
        """Tell the selector what to look for. Only in the loop's thread."""
        if self._sock.fileno() >= 0 and not self._closing:
            writing = selectors.EVENT_WRITE if self._unwritten else 0
            self._loop.watch(self, (selectors.EVENT_READ if self.reading else 0) | writing)

    def shut(self) -> None:
        """Close the connection now. Only from the loop's thread."""
        if self._sock.fileno() < 0:
            return
        with self._changed:
            self._give_up()
        self._loop.forget(self)
        self._sock.close()
        self.on_close()


def _unacknowledged_bytes(sock: socket.socket) -> int:
    """Bytes in the kernel's send buffer that the other side has not acknowledged (``tcp(7)``)."""
    if sys.platform != "linux":
        return 0
    size = fcntl.ioctl(sock.fileno(), termios.TIOCOUTQ, bytes(4))
    (waiting,) = struct.unpack("i", size)
    return int(waiting)
