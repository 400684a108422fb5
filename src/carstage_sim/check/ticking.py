"""Ticks that survive a lost wake-up inside the client wheel.

The Traffic Manager of the wheels up to 0.9.16 starts its synchronous step by setting a flag and
notifying a condition variable without holding the mutex (carla-simulator/carla, issue 9172). When
its thread is between looking at the flag and falling asleep, the notification is lost and
``World.tick`` waits for ever: on busy cores about once in ten thousand ticks. The frame has come by
then, nothing runs, and leaving synchronous mode notifies the same variable once more: the step then
takes place as if nothing had happened, with the same result.
"""

from __future__ import annotations

import logging
import threading
from time import monotonic
from types import TracebackType
from typing import Any, Protocol

logger = logging.getLogger(__name__)

PATIENCE_S = 3.0
_LOOK_EVERY_S = 0.25


class TickedWorld(Protocol):
    """The part of ``carla.World`` that a clock needs."""

    def tick(self) -> int:
        """Makes one frame and returns its number, after the Traffic Manager has taken its step."""

    def get_snapshot(self) -> Any:
        """The newest frame's snapshot; has a ``frame``."""


class CuedByTicks(Protocol):
    """The part of ``carla.TrafficManager`` that a clock needs."""

    def set_synchronous_mode(self, synchronous: bool, /) -> None:
        """Whether its steps wait for the world's ticks."""


class WatchedClock:
    """Ticks a world, and wakes its Traffic Manager when it has overslept; a context manager.

    Args:
        world: in synchronous mode.
        traffic_manager: in synchronous mode.
        patience_s: how long a tick may take after its frame has arrived.

    Attributes:
        wake_ups: how often a lost notification was made up for.
    """

    def __init__(
        self,
        world: TickedWorld,
        traffic_manager: CuedByTicks,
        patience_s: float = PATIENCE_S,
    ) -> None:
        self._world = world
        self._traffic_manager = traffic_manager
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
                # At once back to synchronous mode: the step that begins now still runs in it.
                self.wake_ups += 1
                self._traffic_manager.set_synchronous_mode(False)
                self._traffic_manager.set_synchronous_mode(True)
                waiting_for = None
