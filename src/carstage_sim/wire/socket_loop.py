"""One thread that accepts, reads and finishes writes on non-blocking sockets.

Other threads hand a message to a :class:`~carstage_sim.wire.channel.Channel`, which writes what the
kernel takes at once; the loop's thread writes the rest when there is room. Nothing is copied on the
way. Connections are bounded: above the bound, those go first that never said anything.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import resource
import selectors
import socket
import threading
import time
from collections import deque
from collections.abc import Callable

from carstage_sim.wire.channel import Channel
from carstage_sim.wire.errors import BadAddressError, PortInUseError
from carstage_sim.wire.throttled_warnings import ThrottledWarnings

logger = logging.getLogger(__name__)

_ACCEPT_AGAIN_S = 1.0
_BACKLOG = 128
_MOST_CONNECTIONS = 4096
_OTHER_DESCRIPTORS = 128
_KEEP_ALIVE = {socket.TCP_KEEPIDLE: 30, socket.TCP_KEEPINTVL: 10, socket.TCP_KEEPCNT: 3}
"""A machine that vanishes without a word is noticed after a minute."""


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


class _Listener:
    """A listening socket and the connections that it accepted.

    Args:
        sock: listens and does not block.
        most: connections at a time.
        opened: takes a new connection and makes a channel of it.
        rest: leaves this listener alone for a while.
    """

    def __init__(
        self,
        sock: socket.socket,
        most: int,
        opened: Callable[[socket.socket, str], Channel],
        rest: Callable[[_Listener], None],
    ) -> None:
        self.sock = sock
        self.count = 0
        self.silent: dict[Channel, None] = {}
        self._most = most
        self._opened = opened
        self._rest = rest
        self._warnings = ThrottledWarnings(logger)

    def readable(self) -> None:
        try:
            connection, (peer, *_) = self.sock.accept()
        except (BlockingIOError, ConnectionError):
            return
        except OSError as error:  # too many open files, most likely
            self._warnings.warn("cannot accept a client now", str(error))
            self._drop_silent()
            self._rest(self)
            return
        if self.count >= self._most and not self._drop_silent():
            self._warnings.warn("too many connections", f"{peer} is the one above {self._most}")
            connection.close()
            return
        try:
            channel = self._opened(connection, str(peer))
        except OSError as error:  # gone again already
            logger.debug("connection of %s: %s", peer, error)
            connection.close()
            return
        self.count += 1
        self.silent[channel] = None

    def _drop_silent(self) -> bool:
        """Close the connection that has been open longest without ever sending anything."""
        for channel in self.silent:
            channel.shut()
            return True
        return False


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
        self._accepted_by: dict[Channel, _Listener] = {}
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
        for channel in list(self._accepted_by):
            channel.shut()
        for key in list(self._selector.get_map().values()):
            if isinstance(key.data, _Listener):
                key.data.sock.close()
        for listener in self._resting:
            listener.sock.close()
        self._selector.close()
        self._waker.close()

    def listen(
        self,
        sock: socket.socket,
        accepted: Callable[[Channel], None],
        most: int | None = None,
    ) -> None:
        """Accept connections on a socket of :func:`bind`; the loop owns it from now on.

        Args:
            sock: where to listen.
            accepted: runs in the loop's thread, before anything is read from the connection.
            most: connections at a time; default: what the process's descriptors allow for two
                such listeners, at most 4096.

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

        def opened(connection: socket.socket, peer: str) -> Channel:
            connection.setblocking(False)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            for option, value in _KEEP_ALIVE.items():
                connection.setsockopt(socket.IPPROTO_TCP, option, value)
            channel = Channel(self, connection, peer)
            self._accepted_by[channel] = listener
            accepted(channel)
            self.watch(channel, selectors.EVENT_READ)
            return channel

        listener = _Listener(sock, most or _affordable_connections(), opened, self._rest)
        self.call(lambda: self._register_listener(listener))

    def call(self, action: Callable[[], None]) -> None:
        """Run ``action`` in the loop's thread."""
        self._actions.append(action)
        self._waker.wake()

    def watch(self, channel: Channel, events: int) -> None:
        """Look for these events of a channel, none for 0. Only from the loop's thread."""
        if channel.fileno() not in self._selector.get_map():
            if events:
                self._selector.register(channel, events, channel)
        elif events:
            self._selector.modify(channel, events, channel)
        else:
            self._selector.unregister(channel)

    def spoke(self, channel: Channel) -> None:
        """A channel received something. Only from the loop's thread."""
        channel.silent = False
        self._accepted_by[channel].silent.pop(channel, None)

    def forget(self, channel: Channel) -> None:
        """A channel closes: stop watching it. Only from the loop's thread."""
        self.watch(channel, 0)
        listener = self._accepted_by.pop(channel)
        listener.silent.pop(channel, None)
        listener.count -= 1

    def _register_listener(self, listener: _Listener) -> None:
        self._selector.register(listener.sock, selectors.EVENT_READ, listener)

    def _rest(self, listener: _Listener) -> None:
        """Leave a listener alone for a while: it would be ready, and fail, without a pause."""
        self._selector.unregister(listener.sock)
        self._resting.append(listener)
        self._rest_until_s = time.monotonic() + _ACCEPT_AGAIN_S

    def _run(self) -> None:
        while not self._ending.is_set():
            rest_s = max(self._rest_until_s - time.monotonic(), 0.0) if self._resting else None
            for key, events in self._selector.select(rest_s):
                handler = key.data
                if events & selectors.EVENT_WRITE:
                    handler.writable()
                if events & selectors.EVENT_READ:
                    handler.readable()
            while self._resting and time.monotonic() >= self._rest_until_s:
                self._register_listener(self._resting.pop())
            while self._actions:
                self._actions.popleft()()


def _affordable_connections() -> int:
    """Half of the descriptors that this process may have open, less those it needs otherwise."""
    descriptors, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return max(min((descriptors - _OTHER_DESCRIPTORS) // 2, _MOST_CONNECTIONS), 1)
