"""Ticks that survive a lost wake-up inside the client wheel.

The Traffic Manager of the wheels up to 0.9.16 starts its synchronous step by setting a flag and
notifying a condition variable without holding the mutex (carla-simulator/carla, issue 9172). When
its thread is between looking at the flag and falling asleep, the notification is lost and
``World.tick`` waits for ever: on busy cores about once in some ten thousand ticks. The frame has
come by then and nothing runs. Leaving synchronous mode notifies the same variable once more, and
the step then takes place as if nothing had happened, with the same result.

``carla.TrafficManager`` cannot ask for that: its methods wait for a mutex that the tick holds. The
Traffic Manager's own RPC port takes the call without it.
"""

from __future__ import annotations

import logging
import socket
import threading
from collections.abc import Callable
from time import monotonic
from types import TracebackType
from typing import Any, Protocol

import msgpack

logger = logging.getLogger(__name__)

PATIENCE_S = 3.0
_LOOK_EVERY_S = 0.25
_ANSWER_TIMEOUT_S = 5.0


class TickedWorld(Protocol):
    """The part of ``carla.World`` that a clock needs."""

    def tick(self) -> int:
        """Makes one frame and returns its number, after the Traffic Manager has taken its step."""

    def get_snapshot(self) -> Any:
        """The newest frame's snapshot; has a ``frame``."""


def wake_traffic_manager(port: int) -> None:
    """Notifies the Traffic Manager that listens on a port of this machine of its step again.

    It is told to leave synchronous mode, which notifies, and at once to return to it: the step that
    begins now still ends in synchronous mode.

    Raises:
        OSError: nobody answers there.
    """
    requests = [
        msgpack.packb([0, number, "set_synchronous_mode", [mode]])
        for number, mode in enumerate((False, True))
    ]
    unpacker = msgpack.Unpacker()
    with socket.create_connection(("127.0.0.1", port), timeout=_ANSWER_TIMEOUT_S) as connection:
        connection.sendall(b"".join(requests))
        answered = 0
        while answered < len(requests):
            received = connection.recv(4096)
            if not received:
                raise ConnectionResetError(f"the Traffic Manager on port {port} hung up")
            unpacker.feed(received)
            answered += sum(1 for _ in unpacker)


class WatchedClock:
    """Ticks a world, and wakes its Traffic Manager when it has overslept; a context manager.

    Args:
        world: in synchronous mode.
        wake: makes the Traffic Manager look at its flag again, from another thread.
        patience_s: how long a tick may take after its frame has arrived.

    Attributes:
        wake_ups: how often a lost notification was made up for.
    """

    def __init__(
        self,
        world: TickedWorld,
        wake: Callable[[], None],
        patience_s: float = PATIENCE_S,
    ) -> None:
        self._world = world
        self._wake = wake
        self._patience_s = patience_s
        self._stop = threading.Event()
        self._frame_before: int | None = None
        self._thread = threading.Thread(target=self._watch, name="tick watch", daemon=True)
        self.wake_ups = 0

    def __enter__(self) -> WatchedClock:
        self._thread.start()
        return self

    def __exit__(
        self,
        _type: type[BaseException] | None,
        _value: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self._stop.set()
        self._thread.join()

    def tick(self) -> int:
        """One tick of the world; its frame number."""
        self._frame_before = int(self._world.get_snapshot().frame)
        try:
            frame = self._world.tick()
        finally:
            self._frame_before = None
        return frame

    def _watch(self) -> None:
        waiting_for: int | None = None
        since_s = 0.0
        while not self._stop.wait(_LOOK_EVERY_S):
            before = self._frame_before
            # Before its frame has come, a slow tick is the server's business.
            if before is None or int(self._world.get_snapshot().frame) <= before:
                waiting_for = None
            elif waiting_for != before:
                waiting_for, since_s = before, monotonic()
            elif monotonic() - since_s > self._patience_s and self._frame_before == before:
                logger.warning("the Traffic Manager missed its cue in frame %d: waking it", before)
                self.wake_ups += 1
                self._wake()
                waiting_for = None
