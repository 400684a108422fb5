"""Wakes the client's Traffic Manager when it has slept through its cue.

The wheels up to 0.9.16 start the Traffic Manager's synchronous step by setting a flag and notifying
without holding the mutex (carla-simulator/carla, issue 9172). On busy cores, about once in some ten
thousand ticks, the notification is lost and ``World.tick`` waits for ever, whatever the server. The
frame has come by then and nothing runs; leaving synchronous mode notifies once more, and the step
takes place as if nothing had happened. The Traffic Manager's Python methods cannot ask for that,
because the tick holds their mutex; its own RPC port can.
"""

from __future__ import annotations

import logging
import socket
import threading
import time
from contextlib import contextmanager
from typing import Any, Iterator, Optional

PATIENCE_S = 5.0
LOOK_EVERY_S = 0.5
ANSWER_TIMEOUT_S = 5.0
# MessagePack-RPC: [request, number, "set_synchronous_mode", [false]], then the same with true.
REQUESTS = (
    b"\x94\x00\x00\xb4set_synchronous_mode\x91\xc2\x94\x00\x01\xb4set_synchronous_mode\x91\xc3"
)
# Twice [response, number, no error, no result].
ANSWER_BYTES = 10

_log = logging.getLogger(__name__)


def wake_traffic_manager(port: int) -> None:
    """Have the Traffic Manager on a port of this machine leave synchronous mode and return to it.

    Raises:
        OSError: nobody answers there.
    """
    with socket.create_connection(("127.0.0.1", port), timeout=ANSWER_TIMEOUT_S) as connection:
        connection.sendall(REQUESTS)
        missing = ANSWER_BYTES
        while missing > 0:
            received = connection.recv(missing)
            if not received:
                raise ConnectionResetError("the Traffic Manager on port %d hung up" % port)
            missing -= len(received)


class TickWatch:
    """A thread that looks whether a tick is stuck behind the Traffic Manager.

    Args:
        world: ``carla.World``.
        port: of the Traffic Manager in this process.
        patience_s: how long a tick may take after its frame has come.
        look_every_s: how often to look.

    Attributes:
        wake_ups: how often it was stuck.
    """

    def __init__(
        self,
        world: Any,
        port: int,
        patience_s: float = PATIENCE_S,
        look_every_s: float = LOOK_EVERY_S,
    ) -> None:
        self._world = world
        self._port = port
        self._patience_s = patience_s
        self._look_every_s = look_every_s
        self._frame_before: Optional[int] = None
        self.wake_ups = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="tick watch", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._stop.set()
        self._thread.join()

    @contextmanager
    def over_a_tick(self) -> Iterator[None]:
        """Watch while the block runs, which ticks the world once."""
        self._frame_before = self._world.get_snapshot().frame
        try:
            yield
        finally:
            self._frame_before = None

    def _watch(self) -> None:
        waiting_for: Optional[int] = None
        since_s = 0.0
        while not self._stop.wait(self._look_every_s):
            before = self._frame_before
            # As long as its frame has not come, a slow tick is the server's business.
            if before is None or self._world.get_snapshot().frame <= before:
                waiting_for = None
            elif waiting_for != before:
                waiting_for, since_s = before, time.monotonic()
            elif time.monotonic() - since_s > self._patience_s and self._frame_before == before:
                waiting_for = None
                self._wake(before)

    def _wake(self, frame: int) -> None:
        self.wake_ups += 1
        _log.warning("the Traffic Manager missed its cue after frame %d: waking it", frame)
        try:
            wake_traffic_manager(self._port)
        except OSError as error:
            _log.error("the Traffic Manager cannot be woken: %s", error)
