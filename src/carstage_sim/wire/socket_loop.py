"""One thread that accepts, reads and finishes writes on non-blocking sockets.

Other threads hand a message to a :class:`Channel`, which writes what the kernel takes at once; the
loop's thread writes the rest when there is room. Nothing is copied on the way.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import selectors
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from carstage_sim.wire.errors import BadAddressError, PortInUseError

if TYPE_CHECKING:
    from typing_extensions import Buffer

logger = logging.getLogger(__name__)

_RECEIVE_BYTES = 1 << 18
_ACCEPT_AGAIN_S = 1.0
_BACKLOG = 128


def bind(host: str, port: int) -> socket.socket:
    """Reserve ``host:port`` (0 takes a free port) without accepting connections yet.

    Raises:
        PortInUseError: something else listens there.
    """
    sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind((host, port))
    except OSError as error:
        sock.close()
        if error.errno == errno.EADDRINUSE:
            raise PortInUseError(host, port) from error
        raise BadAddressError(host, port, error.strerror or str(error)) from error
    return sock


class Channel:
    """A connected socket: reads arrive by callback, writes may come from any thread.

    Args:
        loop: the loop that watches the socket.
        sock: a connected socket; the channel owns it.
        peer: host address of the other side.
    """

    def __init__(self, loop: SocketLoop, sock: socket.socket, peer: str) -> None:
        self.peer = peer
        self.on_data: Callable[[bytes], None] = lambda _data: None
        self.on_close: Callable[[], None] = lambda: None
        self._loop = loop
        self._sock = sock
        self._unwritten: deque[memoryview] = deque()
        self._unwritten_bytes = 0
        self._changed = threading.Condition()
        self._closed = False

    @property
    def closed(self) -> bool:
        """Whether the connection is gone."""
        return self._closed

    @property
    def unwritten_bytes(self) -> int:
        """Bytes that the kernel has not taken yet."""
        return self._unwritten_bytes

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
            if self._closed:
                return
            was_idle = not self._unwritten
            self._unwritten.extend(views)
            self._unwritten_bytes += sum(view.nbytes for view in views)
            if was_idle:
                self._write()
                if self._unwritten:
                    self._loop.watch_writes(self)

    def wait_written(self, timeout_s: float) -> bool:
        """Wait until everything is written or the connection is gone; false on timeout."""
        with self._changed:
            return self._changed.wait_for(lambda: self._closed or not self._unwritten, timeout_s)

    def close(self) -> None:
        """Ask the loop to close the connection."""
        self._loop.call(self._shut)

    def _write(self) -> None:
        """Write what the kernel takes. The condition is held."""
        try:
            while self._unwritten:
                sent = self._sock.sendmsg(list(self._unwritten)[:64])
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
            self._unwritten.clear()
            self._unwritten_bytes = 0
            self._loop.call(self._shut)
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
        if data:
            self.on_data(data)
        else:
            self._shut()

    def writable(self) -> bool:
        """Called by the loop when there is room; whether everything is written."""
        with self._changed:
            self._write()
            return not self._unwritten

    def _shut(self) -> None:
        with self._changed:
            if self._closed:
                return
            self._closed = True
            self._unwritten.clear()
            self._unwritten_bytes = 0
            self._changed.notify_all()
        self._loop.forget(self)
        self._sock.close()
        self.on_close()


class _Listener:
    def __init__(
        self,
        sock: socket.socket,
        accepted: Callable[[socket.socket, str], None],
        rest: Callable[[_Listener], None],
    ) -> None:
        self.sock = sock
        self.accepted = accepted
        self.rest = rest

    def readable(self) -> None:
        try:
            connection, address = self.sock.accept()
        except (BlockingIOError, ConnectionError):
            return
        except OSError as error:  # too many open files, most likely
            logger.warning("cannot accept a client now: %s", error)
            self.rest(self)
        else:
            self.accepted(connection, str(address[0]))


class _Waker:
    """Lets other threads interrupt ``select``."""

    def __init__(self) -> None:
        self.receiving, self.sending = socket.socketpair()
        self.receiving.setblocking(False)
        self.sending.setblocking(False)

    def wake(self) -> None:
        # A full pair means that a wake-up is already on its way.
        with contextlib.suppress(BlockingIOError):
            self.sending.send(b"\0")

    def readable(self) -> None:
        with contextlib.suppress(BlockingIOError):
            self.receiving.recv(4096)

    def close(self) -> None:
        self.receiving.close()
        self.sending.close()


class SocketLoop:
    """A selector and its thread; a context manager that ends both and closes every socket."""

    def __init__(self, name: str) -> None:
        self._selector = selectors.DefaultSelector()
        self._waker = _Waker()
        self._selector.register(self._waker.receiving, selectors.EVENT_READ, self._waker)
        self._actions: deque[Callable[[], None]] = deque()
        self._resting: list[_Listener] = []
        self._rest_until_s = 0.0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def __enter__(self) -> SocketLoop:
        self._thread.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        self._ending.set()
        self._waker.wake()
        self._thread.join()
        for key in list(self._selector.get_map().values()):
            if isinstance(key.data, Channel):
                key.data._shut()
            elif isinstance(key.data, _Listener):
                key.data.sock.close()
        for listener in self._resting:
            listener.sock.close()
        self._selector.close()
        self._waker.close()

    def listen(self, sock: socket.socket, accepted: Callable[[Channel], None]) -> None:
        """Accept connections on a socket of :func:`bind`; the loop owns it from now on.

        ``accepted`` runs in the loop's thread, before anything is read from the connection.

        Raises:
            PortInUseError: something else began to listen there since it was bound.
        """
        try:
            sock.listen(_BACKLOG)
        except OSError as error:
            host, port = sock.getsockname()
            sock.close()
            raise PortInUseError(host, port) from error
        sock.setblocking(False)

        def opened(connection: socket.socket, peer: str) -> None:
            connection.setblocking(False)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            channel = Channel(self, connection, peer)
            accepted(channel)
            self._selector.register(channel, selectors.EVENT_READ, channel)

        listener = _Listener(sock, opened, self._rest)
        self.call(lambda: self._register_listener(listener))

    def call(self, action: Callable[[], None]) -> None:
        """Run ``action`` in the loop's thread."""
        self._actions.append(action)
        self._waker.wake()

    def watch_writes(self, channel: Channel) -> None:
        """Finish the channel's writes when there is room."""
        self.call(lambda: self._modify(channel, selectors.EVENT_READ | selectors.EVENT_WRITE))

    def forget(self, channel: Channel) -> None:
        """Stop watching a channel that closes. Only from the loop's thread."""
        with contextlib.suppress(KeyError):
            self._selector.unregister(channel)

    def _register_listener(self, listener: _Listener) -> None:
        self._selector.register(listener.sock, selectors.EVENT_READ, listener)

    def _rest(self, listener: _Listener) -> None:
        """Leave a listener alone for a while: it would be ready, and fail, without a pause."""
        self._selector.unregister(listener.sock)
        self._resting.append(listener)
        self._rest_until_s = time.monotonic() + _ACCEPT_AGAIN_S

    def _modify(self, channel: Channel, events: int) -> None:
        if not channel.closed:
            self._selector.modify(channel, events, channel)

    def _run(self) -> None:
        while not self._ending.is_set():
            rest_s = max(self._rest_until_s - time.monotonic(), 0.0) if self._resting else None
            for key, events in self._selector.select(rest_s):
                handler = key.data
                if events & selectors.EVENT_WRITE and handler.writable():
                    self._modify(handler, selectors.EVENT_READ)
                if events & selectors.EVENT_READ:
                    handler.readable()
            while self._resting and time.monotonic() >= self._rest_until_s:
                self._register_listener(self._resting.pop())
            while self._actions:
                self._actions.popleft()()
